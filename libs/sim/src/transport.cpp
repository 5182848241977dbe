#include "vestibule/sim/transport.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/random.hpp"

namespace vestibule::sim {

void describe(ParamIo& io, Outage& outage) {
  io.required("from_s", outage.from_s, nonNegative());
  io.required("to_s", outage.to_s, nonNegative());
  if (outage.to_s < outage.from_s) io.problem("to_s", "must not be before from_s");
}

void describe(ParamIo& io, StampJump& jump) {
  io.required("at_s", jump.at_s, nonNegative());
  io.required("by_s", jump.by_s);
}

void describe(ParamIo& io, LinkParams& params) {
  io.optional("delay_s", params.delay_s, within(0.0, 60.0));
  io.optional("delay_jitter", params.delay_jitter, within(0.0, 3.0));
  io.optional("in_order", params.in_order);
  io.optional("loss", params.loss, within(0.0, 1.0));
  io.optional("burst_rate_hz", params.burst_rate_hz, within(0.0, 100.0));
  io.optional("burst_s", params.burst_s, positive());
  io.optional("burst_loss", params.burst_loss, within(0.0, 1.0));
  io.optional("duplicate", params.duplicate, within(0.0, 1.0));
  io.optional("clock_offset_s", params.clock_offset_s, within(-1e6, 1e6));
  io.optional("clock_drift_ppm", params.clock_drift_ppm, within(-1e4, 1e4));
  io.list("outages", params.outages);
  io.list("stamp_jumps", params.stamp_jumps);
}

void describe(ParamIo& io, TransportParams& params) {
  io.section("wheels", params.wheels);
  io.section("imu", params.imu);
  io.section("heading", params.heading);
  io.section("gnss", params.gnss);
  io.section("lidar", params.lidar);
}

Transport::Transport(const TransportParams& params, Timestamp start, std::uint64_t seed)
    : params_(params), start_(start), seed_(seed) {
  const auto link = [&](const LinkParams& link_params, const char* name) {
    Link made;
    made.params = &link_params;
    made.name = std::string("link ") + name;
    made.last_arrival = start;
    made.looked = start;
    return made;
  };
  // In the order of the Measurement variant.
  links_ = {
      link(params_.wheels, "wheels"),
      link(params_.imu, "imu"),
      link(params_.heading, "heading"),
      link(params_.gnss, "gnss"),
      link(params_.lidar, "lidar")};
  static_assert(std::variant_size_v<Measurement> == 5);
}

bool Transport::isLost(Link& link, Timestamp now, double now_s) {
  const LinkParams& p = *link.params;
  RandomStream random(seed_, link.name + " loss", link.count);
  const double lot = random.uniform();
  if (p.burst_rate_hz > 0.0) {
    if (link.burst_ends && now >= *link.burst_ends) {
      link.looked = *link.burst_ends;
      link.burst_ends.reset();
    }
    if (!link.burst_ends) {
      const double good_s = toSeconds(now - link.looked);
      if (random.bernoulli(1.0 - std::exp(-p.burst_rate_hz * good_s))) {
        link.burst_ends = now + durationFromSeconds(random.exponential(p.burst_s));
      }
      link.looked = now;
    }
  }
  for (const Outage& outage : p.outages) {
    if (now_s >= outage.from_s && now_s < outage.to_s) return true;
  }
  return lot < (link.burst_ends ? std::max(p.burst_loss, p.loss) : p.loss);
}

void Transport::deliver(Link& link, Timestamp arrival, const Measurement& measurement) {
  if (link.params->in_order) arrival = std::max(arrival, link.last_arrival);
  link.last_arrival = std::max(arrival, link.last_arrival);
  on_the_way_.emplace(arrival.ns, measurement);
}

void Transport::send(Measurement measurement) {
  Link& link = links_[measurement.index()];
  const LinkParams& p = *link.params;
  const Timestamp now = stampOf(measurement);
  const double now_s = toSeconds(now - start_);
  const bool lost = isLost(link, now, now_s);
  RandomStream random(seed_, link.name, link.count++);
  const auto delay = [&] {
    return durationFromSeconds(p.delay_s * std::exp(p.delay_jitter * random.normal()));
  };
  const Duration first = delay();
  const bool twice = random.bernoulli(p.duplicate);
  const Duration second = first + delay();
  if (lost) return;
  double clock_error_s = p.clock_offset_s + 1e-6 * p.clock_drift_ppm * now_s;
  for (const StampJump& jump : p.stamp_jumps) {
    if (now_s >= jump.at_s) clock_error_s += jump.by_s;
  }
  if (clock_error_s != 0.0) {
    std::visit(
        [&](auto& m) { m.stamp = m.stamp + durationFromSeconds(clock_error_s); }, measurement);
  }
  // A scan is complete when its last beam is.
  Timestamp sent = now;
  if (const auto* scan = std::get_if<LaserScan>(&measurement)) {
    sent = now +
           durationFromSeconds(scan->time_increment_s * static_cast<double>(scan->ranges_m.size()));
  }
  deliver(link, sent + first, measurement);
  if (twice) deliver(link, sent + second, measurement);
}

std::vector<Delivered> Transport::receive(Timestamp now) {
  std::vector<Delivered> delivered;
  const auto end = on_the_way_.upper_bound(now.ns);
  for (auto it = on_the_way_.begin(); it != end; ++it) {
    delivered.push_back({Timestamp{it->first}, std::move(it->second)});
  }
  on_the_way_.erase(on_the_way_.begin(), end);
  return delivered;
}

}  // namespace vestibule::sim
