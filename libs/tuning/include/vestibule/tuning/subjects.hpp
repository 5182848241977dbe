#pragma once

#include <memory>
#include <string>

#include "vestibule/pipeline/progress.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/subject.hpp"

namespace vestibule::tuning {

/// Where shipped files lie.
struct Folders {
  std::string csv_mappings;
  std::string scenarios;
};

/// Reads what the session needs (recordings once, scenarios are driven) and gives its subject.
/// Throws InputError for recordings that cannot be read or lack what the session asks of them.
/// \param session outlives the subject
[[nodiscard]] std::unique_ptr<Subject> makeSubject(
    const Session& session, const Folders& folders, const pipeline::Progress& progress);

}  // namespace vestibule::tuning
