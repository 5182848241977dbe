#include "vestibule/amcl/amcl_names.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "vestibule/core/errors.hpp"

namespace vestibule::amcl {
namespace {

using Setter = std::function<void(AmclParams&, double)>;

/// AMCL's alphas scale variances, ours are sigmas.
Setter alpha(double MotionNoise::*member) {
  return [member](AmclParams& p, double value) { p.motion.*member = std::sqrt(value); };
}
Setter field(double LikelihoodField::*member) {
  return [member](AmclParams& p, double value) { p.field.*member = value; };
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
      {"max_beams",
       [](AmclParams& p, double v) {
         p.field.max_beams = std::max(8, static_cast<int>(std::lround(v)));
       }},
      {"min_particles",
       [](AmclParams& p, double v) { p.kld.min_particles = static_cast<int>(std::lround(v)); }},
      {"max_particles",
       [](AmclParams& p, double v) { p.kld.max_particles = static_cast<int>(std::lround(v)); }},
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
      {"kld_err", "pf_err"},
      {"kld_z", "pf_z"},
      {"odom_model_type", "robot_model_type"},
  };
  return table;
}

/// Known to AMCL; frames, topics and what our filter does otherwise.
const std::set<std::string>& withoutCounterpart() {
  static const std::set<std::string> names{
      "always_reset_initial_pose",
      "base_frame_id",
      "bond_heartbeat_period",
      "first_map_only",
      "first_map_only_",
      "force_update_after_initialpose",
      "global_frame_id",
      "gui_publish_rate",
      "initial_cov_aa",
      "initial_cov_xx",
      "initial_cov_yy",
      "lambda_short",
      "laser_lambda_short",
      "laser_min_range",
      "laser_model_type",
      "laser_z_max",
      "laser_z_short",
      "map_topic",
      "odom_frame_id",
      "qos_overrides",
      "random_seed",
      "recovery_alpha_fast",
      "recovery_alpha_slow",
      "resample_interval",
      "save_pose_rate",
      "scan_topic",
      "selective_resampling",
      "service_introspection_mode",
      "spatial_resolution_y",
      "tf_broadcast",
      "transform_tolerance",
      "use_map_topic",
      "use_sim_time",
      "z_max",
      "z_short"};
  return names;
}

std::string where(const std::string& path, const YAML::Node& node) {
  return path + ":" + std::to_string(node.Mark().line + 1) + ": ";
}

double numberOf(const std::string& path, const std::string& name, const YAML::Node& node) {
  double value = 0.0;
  if (!YAML::convert<double>::decode(node, value) || !std::isfinite(value)) {
    throw ConfigError(where(path, node) + name + ": must be a number");
  }
  if (value < 0.0 && name != "laser_max_range") {
    throw ConfigError(
        where(path, node) + name + " = " + std::to_string(value) + ": must not be negative");
  }
  return value;
}

void setModel(const std::string& path, const YAML::Node& node, AmclParams& params) {
  const auto word = node.as<std::string>();
  if (word.find("mni") != std::string::npos) {
    params.motion.model = MotionModel::kOmni;
  } else if (word.find("iff") != std::string::npos) {
    params.motion.model = MotionModel::kDifferential;
  } else {
    throw ConfigError(
        where(path, node) + "robot_model_type = " + word + ": must be differential or omni");
  }
}

/// The parameters themselves, wherever the file has them.
YAML::Node parametersIn(const YAML::Node& root) {
  YAML::Node node = root;
  for (const char* key : {"/**", "amcl", "ros__parameters"}) {
    if (node.IsMap() && node[key]) node.reset(node[key]);
  }
  return node;
}

}  // namespace

AmclNames applyAmclFile(const std::string& path, AmclParams& params) {
  YAML::Node root;
  try {
    root = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw InputError(path + ": cannot be read; give a parameter file of nav2_amcl or amcl");
  } catch (const YAML::Exception& e) {
    throw ConfigError(path + ":" + std::to_string(e.mark.line + 1) + ": " + e.msg);
  }
  const YAML::Node parameters = parametersIn(root);
  if (!parameters.IsMap()) {
    throw ConfigError(path + ": no parameters in it; expected `amcl: ros__parameters:` or names");
  }

  AmclNames result;
  Pose2 initial;
  bool has_initial = false;
  const auto setInitial = [&](const std::string& axis, const YAML::Node& node) {
    double value = 0.0;
    if (!YAML::convert<double>::decode(node, value)) {
      throw ConfigError(where(path, node) + "initial_pose " + axis + ": must be a number");
    }
    (axis == "x" ? initial.x : axis == "y" ? initial.y : initial.phi) = value;
    has_initial = true;
  };
  for (const auto& entry : parameters) {
    const auto name = entry.first.as<std::string>();
    const YAML::Node& value = entry.second;
    const auto synonym = synonyms().find(name);
    const std::string& usual = synonym == synonyms().end() ? name : synonym->second;
    const auto number = numbers().find(usual);
    if (number != numbers().end()) {
      number->second(params, numberOf(path, name, value));
    } else if (usual == "robot_model_type") {
      setModel(path, value, params);
    } else if (usual == "do_beamskip") {
      params.beam_skipping.enabled = value.as<bool>(params.beam_skipping.enabled);
    } else if (name == "initial_pose" && value.IsMap()) {
      for (const char* axis : {"x", "y", "yaw"}) {
        if (value[axis]) setInitial(axis, value[axis]);
      }
    } else if (name == "initial_pose_x" || name == "initial_pose_y") {
      setInitial(name.substr(name.size() - 1), value);
    } else if (name == "initial_pose_a") {
      setInitial("yaw", value);
    } else if (name == "set_initial_pose") {
      if (!value.as<bool>(true)) continue;
    } else {
      (withoutCounterpart().count(name) != 0 ? result.ignored : result.unknown).push_back(name);
      continue;
    }
    result.applied.push_back(name);
  }
  if (params.kld.min_particles > params.kld.max_particles) {
    throw ConfigError(path + ": min_particles must not exceed max_particles");
  }
  if (has_initial) result.T_map_base_init = initial;
  return result;
}

}  // namespace vestibule::amcl
