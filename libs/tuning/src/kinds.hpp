#pragma once

#include <memory>

#include "vestibule/pipeline/progress.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/subject.hpp"
#include "vestibule/tuning/subjects.hpp"

namespace vestibule::tuning {

/// The GNSS/IMU/wheel filter. The seed moves the windows without GNSS inside their blocks.
[[nodiscard]] std::unique_ptr<Subject> makeEkfSubject(
    const Session& session, const Folders& folders, const pipeline::Progress& progress);

/// Particle localization; the seed is the filter's.
[[nodiscard]] std::unique_ptr<Subject> makeAmclSubject(
    const Session& session, const Folders& folders);

/// Mapping; the seed is the filter's.
[[nodiscard]] std::unique_ptr<Subject> makeMappingSubject(
    const Session& session, const Folders& folders);

}  // namespace vestibule::tuning
