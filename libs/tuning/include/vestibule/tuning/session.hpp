#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/pipeline/config.hpp"

namespace vestibule::tuning {

/// What is run for every candidate.
enum class SubjectKind { kEkf, kAmcl, kMapping };

/// What is measured of a run. Each gives one number per block of the recording.
enum class Measure {
  kInnovation,      ///< minus log likelihood of the innovations, per degree of freedom; no truth
  kHiddenOutage,    ///< [m] end of a window without GNSS, against the hidden fix
  kApe,             ///< [m] position against the reference
  kRpe,             ///< [m] relative position over rpe_s, against the reference
  kOdometryRpe,     ///< the same of T_odom_base
  kNees,            ///< consistency with the reference: |ln(mean NEES / dof)|
  kNis,             ///< consistency of the innovations: |ln(mean NIS / dof)|
  kRelations,       ///< [m] relations metric
  kScanLikelihood,  ///< minus log likelihood per beam of scans that are not in the map
  kWallThickness  ///< [m] area of the map's walls over half their outline: doubled walls are thick
};
[[nodiscard]] std::string_view toString(Measure measure);
[[nodiscard]] std::string_view toString(SubjectKind kind);

struct TunedParameter {
  std::string name;
  double from = 0.0;
  double to = 0.0;
  bool log = true;                ///< searched in the logarithm
  std::vector<std::string> ties;  ///< keep their ratio to this one
  SourceRef where;
};

/// Which blocks of a recording count.
enum class Blocks { kAll, kEven, kOdd };

struct RecordingSpec {
  std::string log;               ///< path; empty for a simulated drive
  std::string scenario;          ///< simulated instead: name or path
  std::uint64_t first_seed = 1;  ///< of the simulated drives
  int drives = 1;
  Blocks blocks = Blocks::kAll;
  std::string ref;            ///< TUM; empty: the recording's own reference, if it has one
  std::string map;            ///< amcl: map_server YAML or other map file
  std::optional<Pose2> init;  ///< amcl: start pose; empty = unknown
  std::string relations;      ///< mapping
  SourceRef where;
  [[nodiscard]] std::string name() const;
};

/// What the recordings are for.
enum class Role { kTraining, kValidation, kFinal };
inline constexpr Role kRoles[] = {Role::kTraining, Role::kValidation, Role::kFinal};
[[nodiscard]] std::string_view toString(Role role);

struct Recordings {
  std::vector<RecordingSpec> training;
  std::vector<RecordingSpec> validation;
  std::vector<RecordingSpec> final;
  [[nodiscard]] const std::vector<RecordingSpec>& of(Role role) const;
};

struct Objective {
  Measure measure = Measure::kInnovation;
  double weight = 1.0;
  double length_s = 30.0;  ///< hidden_outage
  double step_s = 10.0;    ///< rpe, odometry_rpe
  SourceRef where;
};

/// Common random numbers: every candidate meets the same seeds.
struct Seeds {
  std::uint64_t first = 1;
  int count = 1;   ///< during the search
  int fresh = 10;  ///< others, for the winners and the validation
};

enum class GlobalAlgorithm { kAuto, kDirectL, kCrs2, kIsres, kNone };
enum class LocalAlgorithm { kAuto, kBobyqa, kSbplx, kNone };

struct SearchSpec {
  GlobalAlgorithm global = GlobalAlgorithm::kAuto;
  LocalAlgorithm local = LocalAlgorithm::kAuto;
  int evaluations = 200;      ///< candidates asked for by the search
  int islands = 2;            ///< searches side by side
  double global_share = 0.6;  ///< of the evaluations
  double wall_s = 0.0;        ///< [s] the search stops after this; 0 = no limit
  int threads = 0;            ///< 0 = one per core; the result does not depend on it
  bool slices = true;         ///< sensitivity of the winner, after the search
};

struct Acceptance {
  double gain = 0.05;  ///< least gain on the validation data
  double confidence = 0.95;
};

struct Limits {
  double cpu_ms_per_data_s = 0.0;  ///< [ms] a candidate that needs more is refused; 0 = no limit
};

/// A tuning session; file format: docs/tuning.md.
struct Session {
  std::string path;
  SubjectKind subject = SubjectKind::kEkf;
  std::string config_path;
  pipeline::Config base;  ///< of config_path
  std::vector<TunedParameter> parameters;
  Recordings recordings;
  double block_s = 60.0;
  std::vector<Objective> objectives;
  Seeds seeds;
  SearchSpec search;
  Acceptance accept;
  Limits limits;
};
void describe(ParamIo& io, Session& session);

/// Throws ConfigError with file:line of every problem.
/// \param scenario_folder where scenario names are looked up
[[nodiscard]] Session loadSession(const std::string& path, const std::string& scenario_folder);
[[nodiscard]] Session parseSession(
    const std::string& yaml, const std::string& name, const std::string& scenario_folder);

}  // namespace vestibule::tuning
