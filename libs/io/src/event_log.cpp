#include "vestibule/io/event_log.hpp"

#include <cmath>
#include <cstdio>
#include <ostream>
#include <string>

namespace vestibule::io {
namespace {

/// One JSON object, keys in the order they are added.
class JsonLine {
 public:
  JsonLine(Timestamp stamp, std::string_view type) {
    add("t", formatSeconds(stamp));
    add("type", type);
  }
  JsonLine& add(std::string_view key, std::string_view text) {
    name(key);
    quote(text);
    return *this;
  }
  JsonLine& add(std::string_view key, double value) {
    name(key);
    text_ += number(value);
    return *this;
  }
  JsonLine& add(std::string_view key, long long value) {
    name(key);
    text_ += std::to_string(value);
    return *this;
  }
  JsonLine& addValues(const std::vector<std::pair<std::string, double>>& values) {
    name("values");
    text_ += '{';
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (i > 0) text_ += ',';
      quote(values[i].first);
      text_ += ':' + number(values[i].second);
    }
    text_ += '}';
    return *this;
  }
  [[nodiscard]] std::string line() const { return "{" + text_ + "}\n"; }

 private:
  // JSON knows neither NaN nor infinity.
  static std::string number(double value) {
    if (!std::isfinite(value)) return "null";
    char text[40];
    std::snprintf(text, sizeof text, "%.9g", value);
    return text;
  }
  void name(std::string_view key) {
    if (!text_.empty()) text_ += ',';
    quote(key);
    text_ += ':';
  }
  void quote(std::string_view text) {
    text_ += '"';
    for (const char c : text) {
      if (c == '"' || c == '\\') {
        text_ += '\\';
        text_ += c;
      } else if (static_cast<unsigned char>(c) < 0x20) {
        char escaped[8];
        std::snprintf(escaped, sizeof escaped, "\\u%04x", static_cast<unsigned>(c));
        text_ += escaped;
      } else {
        text_ += c;
      }
    }
    text_ += '"';
  }

  std::string text_;
};

}  // namespace

void EventLog::onUpdate(const UpdateEvent& event) {
  JsonLine line(event.stamp, "update");
  line.add("sensor", event.sensor)
      .add("decision", toString(event.decision))
      .add("reason", event.reason)
      .add("nis", event.nis)
      .add("gate", event.gate)
      .add("dof", static_cast<long long>(event.dof));
  out_ << line.line();
}

void EventLog::onParticles(const ParticlesEvent& event) {
  JsonLine line(event.stamp, "particles");
  line.add("count", static_cast<long long>(event.T_map_particles.size()))
      .add("ess", event.effective_sample_size)
      .add("inlier_share", event.inlier_share)
      .add("lost_probability", event.lost_probability)
      .add("unmapped_beams", static_cast<long long>(event.p_map_unmapped.size()));
  out_ << line.line();
}

void EventLog::onPlaces(const PlacesEvent& event) {
  JsonLine line(event.stamp, "places");
  line.add("state", event.state)
      .add("searches", static_cast<long long>(event.searches))
      .add("places", static_cast<long long>(event.places.size()));
  if (!event.places.empty()) {
    const auto& [T, weight] = event.places.front();
    line.add("x", T.x).add("y", T.y).add("yaw", T.phi).add("weight", weight);
  }
  out_ << line.line();
}

void EventLog::onMode(const ModeEvent& event) {
  JsonLine line(event.stamp, "mode");
  line.add("from", toString(event.from))
      .add("to", toString(event.to))
      .add("reason", event.reason)
      .addValues(event.values);
  out_ << line.line();
}

void EventLog::onMap(const MapEvent& event) {
  JsonLine line(event.stamp, "map");
  line.add("kind", toString(event.kind)).add("map", event.map).add("distance_m", event.distance_m);
  out_ << line.line();
}

void EventLog::onMission(const MissionEvent& event) {
  JsonLine line(event.stamp, "mission");
  line.add("kind", toString(event.kind))
      .add("path", event.path)
      .add("waypoint", event.waypoint)
      .add("text", event.text);
  out_ << line.line();
}

void EventLog::onWarning(const WarningEvent& event) {
  JsonLine line(event.stamp, "warning");
  line.add("component", event.component)
      .add("text", event.text)
      .add("value", event.value)
      .add("limit", event.limit);
  out_ << line.line();
}

}  // namespace vestibule::io
