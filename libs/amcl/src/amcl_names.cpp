#include "vestibule/amcl/amcl_names.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "amcl_file.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::amcl {
namespace {

const std::string kQos = "qos_overrides";  // a table of its own below it

using Setter = std::function<void(AmclParams&, double)>;

/// AMCL's alphas scale variances, ours are sigmas.
Setter alpha(double MotionNoise::*member) {
  return [member](AmclParams& p, double value) { p.motion.*member = std::sqrt(value); };
}
Setter field(double LikelihoodField::*member) {
  return [member](AmclParams& p, double value) { p.field.*member = value; };
}

int whole(double value) {
  constexpr double kMost = 2e9;  // far beyond every bound
  return static_cast<int>(std::lround(std::clamp(value, -kMost, kMost)));
}

/// AMCL calls it the quantile of the normal distribution, but its default 0.99 is the probability:
/// below 1 it is taken for that.
void setKldZ(AmclParams& p, double z) {
  p.kld.delta = z < 1.0 ? 1.0 - z : 0.5 * std::erfc(z / std::sqrt(2.0));
}

const std::map<std::string, Setter>& numbers() {
  static const std::map<std::string, Setter> table{
      {"alpha1", alpha(&MotionNoise::rot_per_rot)},
      {"alpha2", alpha(&MotionNoise::rot_per_trans)},
      {"alpha3", alpha(&MotionNoise::trans_per_trans)},
      {"alpha4", alpha(&MotionNoise::trans_per_rot)},
      {"alpha5", alpha(&MotionNoise::lateral_per_trans)},
      {"z_hit", field(&LikelihoodField::z_hit)},
      {"z_rand", field(&LikelihoodField::z_rand)},
      {"sigma_hit", field(&LikelihoodField::sigma_hit_m)},
      {"laser_likelihood_max_dist", field(&LikelihoodField::max_distance_m)},
      {"laser_max_range",
       [](AmclParams& p, double v) {
         if (v > 0.0 && v < 1000.0) p.field.max_range_m = v;  // -1 and 100: the laser's own
       }},
      {"max_beams", [](AmclParams& p, double v) { p.field.max_beams = whole(v); }},
      {"min_particles", [](AmclParams& p, double v) { p.kld.min_particles = whole(v); }},
      {"max_particles", [](AmclParams& p, double v) { p.kld.max_particles = whole(v); }},
      {"pf_err", [](AmclParams& p, double v) { p.kld.epsilon = v; }},
      {"pf_z", setKldZ},
      {"spatial_resolution_x", [](AmclParams& p, double v) { p.kld.bin_m = v; }},
      {"spatial_resolution_theta", [](AmclParams& p, double v) { p.kld.bin_rad = v; }},
      {"update_min_d", [](AmclParams& p, double v) { p.update_min_d_m = v; }},
      {"update_min_a", [](AmclParams& p, double v) { p.update_min_a_rad = v; }},
      {"beam_skip_distance", [](AmclParams& p, double v) { p.beam_skipping.distance_m = v; }},
      {"beam_skip_threshold", [](AmclParams& p, double v) { p.beam_skipping.min_share = v; }},
      {"beam_skip_error_threshold",
       [](AmclParams& p, double v) { p.beam_skipping.max_skipped = v; }},
  };
  return table;
}

const std::map<std::string, std::string>& synonyms() {
  static const std::map<std::string, std::string> table{
      {"odom_alpha1", "alpha1"},
      {"odom_alpha2", "alpha2"},
      {"odom_alpha3", "alpha3"},
      {"odom_alpha4", "alpha4"},
      {"odom_alpha5", "alpha5"},
      {"laser_z_hit", "z_hit"},
      {"laser_z_rand", "z_rand"},
      {"laser_sigma_hit", "sigma_hit"},
      {"laser_max_beams", "max_beams"},
      {"laser_lambda_short", "lambda_short"},
      {"laser_z_max", "z_max"},
      {"laser_z_short", "z_short"},
      {"kld_err", "pf_err"},
      {"kld_z", "pf_z"},
      {"odom_model_type", "robot_model_type"},
  };
  return table;
}

/// Known to AMCL and without effect here: why.
const std::map<std::string, std::string>& withoutCounterpart() {
  static const std::map<std::string, std::vector<std::string>> reasons{
      {"no ROS here",
       {"base_frame_id",
        "bond_disable_heartbeat_timer",
        "bond_heartbeat_period",
        "first_map_only",
        "first_map_only_",
        "freespace_downsampling",
        "global_frame_id",
        "gui_publish_rate",
        "introspection_mode",
        "map_topic",
        "odom_frame_id",
        kQos,
        "restore_defaults",
        "save_pose_rate",
        "scan_topic",
        "service_introspection_mode",
        "tf_broadcast",
        "transform_tolerance",
        "use_map_topic",
        "use_sim_time"}},
      {"always the likelihood field", {"laser_model_type"}},
      {"of the beam model", {"lambda_short", "z_max", "z_short"}},
      {"a scan brings its own", {"laser_min_range"}},
      {"a start pose is good for 0.25 m and 8 degrees",
       {"always_reset_initial_pose",
        "force_update_after_initialpose",
        "force_update_after_set_map",
        "initial_cov_aa",
        "initial_cov_xx",
        "initial_cov_yy"}},
      {"in the plane", {"initial_pose.z"}},
      {"lost robots search the map, see amcl.recovery",
       {"recovery_alpha_fast", "recovery_alpha_slow"}},
      {"resampled when too few particles carry the weight, see amcl.resampling",
       {"resample_interval", "selective_resampling"}},
      {"the x of it counts", {"spatial_resolution_y"}},
      {"given by --config", {"random_seed"}}};
  static const std::map<std::string, std::string> table = [] {
    std::map<std::string, std::string> by_name;
    for (const auto& [reason, names] : reasons) {
      for (const std::string& name : names) by_name[name] = reason;
    }
    return by_name;
  }();
  return table;
}

double numberOf(const AmclEntry& entry) {
  double value = 0.0;
  if (!YAML::convert<double>::decode(entry.value, value) || !std::isfinite(value)) {
    throw ConfigError(entry.where + entry.name + ": must be a number");
  }
  return value;
}

bool truthOf(const AmclEntry& entry) {
  bool value = false;
  if (!YAML::convert<bool>::decode(entry.value, value)) {
    throw ConfigError(entry.where + entry.name + ": must be true or false");
  }
  return value;
}

/// Throws what our own rules say about the value, in the words of the file.
void checkNumber(const AmclEntry& entry, const Setter& set, double value) {
  if (value < 0.0 && entry.name != "laser_max_range") {
    throw ConfigError(
        entry.where + entry.name + " = " + entry.value.Scalar() + ": must not be negative");
  }
  AmclParams alone;
  alone.kld.min_particles = 50;  // apart, so that one of them alone is judged by itself
  alone.kld.max_particles = 1'000'000;
  set(alone, value);
  try {
    (void)parseParams<AmclParams>(dumpParams(alone), "amcl");
  } catch (const ConfigError& e) {
    const std::string text = e.what();  // "amcl:line: name = value: rule"
    throw ConfigError(
        entry.where + entry.name + " = " + entry.value.Scalar() + " is amcl." +
        text.substr(std::min(text.size(), text.find(": ") + 2)));
  }
}

void setModel(const AmclEntry& entry, AmclParams& params) {
  const std::string word = entry.value.IsScalar() ? entry.value.Scalar() : std::string();
  if (word.find("mni") != std::string::npos) {
    params.motion.model = MotionModel::kOmni;
  } else if (word.find("iff") != std::string::npos) {
    params.motion.model = MotionModel::kDifferential;
  } else {
    throw ConfigError(entry.where + entry.name + " = " + word + ": must be differential or omni");
  }
}

/// The coordinate of the start pose that a name stands for.
double* coordinateOf(const std::string& name, Pose2& pose) {
  if (name == "initial_pose.x" || name == "initial_pose_x") return &pose.x;
  if (name == "initial_pose.y" || name == "initial_pose_y") return &pose.y;
  if (name == "initial_pose.yaw" || name == "initial_pose_a") return &pose.phi;
  return nullptr;
}

}  // namespace

AmclNames applyAmclFile(const std::string& path, AmclParams& params) {
  return applyAmclText(readAmclFile(path), path, params);
}

AmclNames applyAmclText(const std::string& text, const std::string& path, AmclParams& params) {
  AmclNames result;
  Pose2 initial;
  bool has_initial = false;
  bool use_initial = true;
  std::set<std::string> seen;
  for (const AmclEntry& entry : parseAmclFile(text, path)) {
    const auto synonym = synonyms().find(entry.name);
    const std::string& name = synonym == synonyms().end() ? entry.name : synonym->second;
    const auto ignored = withoutCounterpart().find(
        name.compare(0, kQos.size(), kQos) == 0 ? name.substr(0, kQos.size()) : name);
    if (!seen.insert(name).second) throw ConfigError(entry.where + entry.name + ": given twice");
    if (const auto number = numbers().find(name); number != numbers().end()) {
      const double value = numberOf(entry);
      checkNumber(entry, number->second, value);
      number->second(params, value);
    } else if (double* coordinate = coordinateOf(name, initial)) {
      *coordinate = numberOf(entry);
      has_initial = true;
    } else if (name == "robot_model_type") {
      setModel(entry, params);
    } else if (name == "do_beamskip") {
      params.beam_skipping.enabled = truthOf(entry);
    } else if (name == "set_initial_pose") {
      use_initial = truthOf(entry);
    } else if (name == "initial_pose") {
      throw ConfigError(entry.where + "initial_pose: must have x, y and yaw below it");
    } else if (ignored != withoutCounterpart().end()) {
      result.ignored[ignored->second].push_back(entry.name);
      continue;
    } else {
      result.unknown.push_back(entry.name);
      continue;
    }
    result.applied.push_back(entry.name);
  }
  if (result.applied.empty() && result.ignored.empty()) {
    throw ConfigError(path + ": no parameter of AMCL in it; expected `amcl: ros__parameters:`");
  }
  if (params.kld.min_particles > params.kld.max_particles) {
    throw ConfigError(
        path + ": min_particles = " + std::to_string(params.kld.min_particles) +
        " must not exceed max_particles = " + std::to_string(params.kld.max_particles));
  }
  if (has_initial && use_initial) result.T_map_base_init = initial;
  return result;
}

}  // namespace vestibule::amcl
