#pragma once

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::mode_manager {

/// How corrections of the published pose are spread over time.
struct SlewParams {
  double time_constant_s = 1.5;
  double max_mps = 0.25;             ///< 2.5 cm per 100 ms
  double max_radps = degToRad(2.5);  ///< 0.25 deg per 100 ms
  double warn_beyond_m = 1.5;        ///< a larger pending correction is announced
};

/// Where along the way to a building things happen. Distances to the outline, negative inside.
struct ZoneParams {
  double seed_within_m = 30.0;   ///< the particles run in shadow inside this distance
  double enter_within_m = 22.0;  ///< the map may get authority inside this distance
  double leave_beyond_m = 27.0;  ///< beyond it GNSS has authority whenever it is healthy
};

/// What makes an estimate eligible.
struct EvidenceParams {
  double enter_trust = 0.60;           ///< share of beams on mapped obstacles, to gain authority
  double keep_trust = 0.45;            ///< to keep it
  double max_particle_sigma_m = 0.40;  ///< spread per axis
  double max_particle_age_s = 1.5;
  double max_fix_age_s = 2.5;  ///< since the last accepted fix
  double max_gnss_sigma_m = 6.0;
  /// GNSS errors last for minutes and the filter cannot see them: added to its sigma when the two
  /// estimates are compared and when particles are seeded.
  double gnss_bias_sigma_m = 1.0;
  double agree_probability = 0.999;  ///< chi-square, 3 degrees of freedom
};

struct HysteresisParams {
  double enter_hold_s = 1.0;     ///< evidence must last this long to give the map authority
  double leave_hold_s = 3.0;     ///< ... to give GNSS authority back
  double loss_hold_s = 1.0;      ///< ... to take authority away from an estimate that failed
  double seed_interval_s = 3.0;  ///< between two tries to seed the particles
  double lost_after_m = 80.0;    ///< dead-reckoned distance after which the robot is lost
};

struct ModeManagerParams {
  SlewParams slew;
  ZoneParams zones;
  EvidenceParams evidence;
  HysteresisParams hysteresis;
};

void describe(ParamIo& io, SlewParams& p);
void describe(ParamIo& io, ZoneParams& p);
void describe(ParamIo& io, EvidenceParams& p);
void describe(ParamIo& io, HysteresisParams& p);
void describe(ParamIo& io, ModeManagerParams& p);

}  // namespace vestibule::mode_manager
