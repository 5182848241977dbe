#include "reactive_config.hpp"

#include <algorithm>
#include <sstream>

#include "vestibule/core/angles.hpp"

namespace vestibule::mrpt_adapters {
namespace {

// Scores of a candidate motion, in the expression language of MRPT's motion optimizer. A path that
// runs into something before it reaches the goal's distance counts little; nearness of its end to
// the goal counts most.
constexpr const char* kScores = R"(
[CMultiObjectiveMotionOptimizerBase]
score1_name = target_distance
score1_formula = var d := max(0, target_d_norm - move_cur_d); if (collision_free_distance > d, 1 / (1 + d^2), 0)
score2_name = free_distance
score2_formula = var d := max(0, target_d_norm - move_cur_d); if (collision_free_distance > (d + 0.05), 1.0, collision_free_distance)
score3_name = euclidean_nearness
score3_formula = 1 / (1 + dist_eucl_min^2)
score4_name = hysteresis_score
score4_formula = hysteresis
score5_name = path_index_near_target
score5_formula = var k := abs(target_k - move_k); if (k > (num_paths / 2)) { k := num_paths - k; }; exp(-abs(k / (num_paths / 10.0)))
score6_name = ptg_priority_score
score6_formula = ptg_priority
scores_to_normalize =

[CMultiObjMotionOpt_Scalarization]
scalar_score_formula = ptg_priority_score * (0.3 * target_distance + 2.0 * free_distance + 2.0 * euclidean_nearness + 0.5 * hysteresis_score + 0.2 * path_index_near_target)
)";

// Choice of a direction within one family of paths: [0] free distance, [1] nearness in sectors,
// [2] nearness of the end to the goal, [3] staying with the last choice, [4] clearance along the
// path, [5] like 2 also where obstructed, [6] nearness to the goal's direction.
constexpr const char* kHolonomic = R"(
[CHolonomicFullEval]
factorWeights = [0.25, 0.1, 1, 0.05, 0.5, 1, 1]
factorNormalizeOrNot = [0, 0, 0, 0, 1, 1, 0]
TOO_CLOSE_OBSTACLE = 0.03
TARGET_SLOW_APPROACHING_DISTANCE = 0.15
OBSTACLE_SLOW_DOWN_DISTANCE = 0.15
HYSTERESIS_SECTOR_COUNT = 5
LOG_SCORE_MATRIX = false
clearance_threshold_ratio = 0.10
gap_width_ratio_threshold = 0.20
PHASE_COUNT = 3
PHASE1_FACTORS = [6]
PHASE1_THRESHOLD = 0.5
PHASE2_FACTORS = [4]
PHASE2_THRESHOLD = 0.7
PHASE3_FACTORS = [0 2]
PHASE3_THRESHOLD = 0.7
[CHolonomicND]
WIDE_GAP_SIZE_PERCENT = 0.25
MAX_SECTOR_DIST_FOR_D2_PERCENT = 0.25
RISK_EVALUATION_SECTORS_PERCENT = 0.1
RISK_EVALUATION_DISTANCE = 0.4
TOO_CLOSE_OBSTACLE = 0.03
TARGET_SLOW_APPROACHING_DISTANCE = 0.15
factorWeights = 1.00 0.50 2.00 0.40
)";

void writePtg(std::ostringstream& out, int index, const char* type, const ReactiveParams& p) {
  const std::string key = "PTG" + std::to_string(index) + "_";
  out << key << "Type = " << type << "\n"
      << key << "resolution = 0.05\n"
      << key << "refDistance = " << p.reference_distance_m << "\n"
      << key << "num_paths = " << p.paths_per_ptg << "\n"
      << key << "v_max_mps = " << p.max_speed_mps << "\n"
      << key << "w_max_dps = " << radToDeg(p.max_yaw_rate_radps) << "\n"
      << key << "score_priority = 1.0\n";
}

}  // namespace

std::string reactiveConfig(const ReactiveParams& params) {
  std::ostringstream out;
  out.precision(12);
  out << "[CAbstractNavigator]\n"
      << "dist_to_target_for_sending_event = 0\n"
      // Ours comes first; MRPT's own is the second line of defence.
      << "alarm_seems_not_approaching_target_timeout = " << 4.0 * params.blocked_after_s << "\n"
      << "dist_check_target_is_blocked = 1.0\n"
      << "hysteresis_check_target_is_blocked = 10\n"
      << "enable_time_profiler = false\n"
      << "[CWaypointsNavigator]\n"
      << "max_distance_to_allow_skip_waypoint = -1\n"
      << "min_timesteps_confirm_skip_waypoints = 1\n"
      << "waypoint_angle_tolerance = 5\n"
      << "multitarget_look_ahead = 0\n"
      << "[CAbstractPTGBasedReactive]\n"
      << "robotMax_V_mps = " << params.max_speed_mps << "\n"
      << "robotMax_W_degps = " << radToDeg(params.max_yaw_rate_radps) << "\n"
      << "holonomic_method = CHolonomicND\n"
      << "motion_decider_method = CMultiObjMotionOpt_Scalarization\n"
      << "ref_distance = " << params.reference_distance_m << "\n"
      << "secure_distance_start = 0.03\n"
      << "secure_distance_end = 0.20\n"
      << "use_delays_model = false\n"
      << "max_distance_predicted_actual_path = 0.15\n"
      << "min_normalized_free_space_for_ptg_continuation = 0.2\n"
      << "enable_obstacle_filtering = false\n"
      << "evaluate_clearance = false\n"
      << kHolonomic << kScores << "[CReactiveNavigationSystem]\n"
      << "min_obstacles_height = 0\n"
      << "max_obstacles_height = 10\n"
      << "PTG_COUNT = 2\n";
  // Forward only: the lidar does not see behind.
  writePtg(out, 0, "CPTG_DiffDrive_C", params);
  out << "PTG0_K = 1.0\n";
  writePtg(out, 1, "CPTG_DiffDrive_alpha", params);
  out << "PTG1_cte_a0v_deg = 57\nPTG1_cte_a0w_deg = 57\n";
  const double x = params.footprint.half_length_m + params.security_margin_m;
  const double y = params.footprint.half_width_m + params.security_margin_m;
  out << "RobotModel_shape2D_xs = " << -x << " " << x << " " << x << " " << -x << "\n"
      << "RobotModel_shape2D_ys = " << y << " " << y << " " << -y << " " << -y << "\n"
      << "RobotModel_circular_shape_radius = " << params.footprint.radius() << "\n";
  return out.str();
}

}  // namespace vestibule::mrpt_adapters
