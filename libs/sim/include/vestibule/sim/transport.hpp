#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/params.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::sim {

/// A time in which a sensor says nothing, in seconds after the start.
struct Outage {
  double from_s = 0.0;
  double to_s = 0.0;
};
/// From this time on the sensor's stamps are off by this much more.
struct StampJump {
  double at_s = 0.0;
  double by_s = 0.0;
};

/// The way of one sensor's messages to the computer.
struct LinkParams {
  double delay_s = 0.0;          ///< median
  double delay_jitter = 0.0;     ///< sigma of the delay's logarithm
  bool in_order = true;          ///< a message waits for the one before it
  double loss = 0.0;             ///< of single messages
  double burst_rate_hz = 0.0;    ///< beginnings of bad times (Gilbert 1960, Elliott 1963)
  double burst_s = 1.0;          ///< their mean length
  double burst_loss = 0.9;       ///< of messages within them
  double duplicate = 0.0;        ///< of messages that come twice
  double clock_offset_s = 0.0;   ///< of the sensor's clock
  double clock_drift_ppm = 0.0;  ///< of the sensor's clock
  std::vector<Outage> outages;
  std::vector<StampJump> stamp_jumps;
};
void describe(ParamIo& io, LinkParams& params);

struct TransportParams {
  LinkParams wheels;
  LinkParams imu;
  LinkParams heading;
  LinkParams gnss;
  LinkParams lidar;
};
void describe(ParamIo& io, TransportParams& params);

/// A measurement as the computer gets it: `measurement` carries the stamp of the sensor's clock.
struct Delivered {
  Timestamp arrival;
  Measurement measurement;
};

/// Carries measurements from the sensors to the computer. Every link draws from streams of its
/// own, numbered by its messages.
class Transport {
 public:
  Transport(const TransportParams& params, Timestamp start, std::uint64_t seed);
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  /// \pre measurements of one kind come in the order of their true stamps
  void send(Measurement measurement);
  /// What has arrived up to and including `now`, by arrival; at equal arrivals in sending order.
  [[nodiscard]] std::vector<Delivered> receive(Timestamp now);

 private:
  struct Link {
    const LinkParams* params = nullptr;
    std::string name;
    std::uint64_t count = 0;
    Timestamp last_arrival{};
    std::optional<Timestamp> burst_ends;
    Timestamp looked{};  // up to here the beginning of bursts was drawn
  };
  void deliver(Link& link, Timestamp arrival, const Measurement& measurement);
  bool isLost(Link& link, Timestamp now, double now_s);

  TransportParams params_;
  Timestamp start_;
  std::uint64_t seed_;
  std::vector<Link> links_;                              // by Measurement::index()
  std::multimap<std::int64_t, Measurement> on_the_way_;  // by arrival [ns], then sending order
};

}  // namespace vestibule::sim
