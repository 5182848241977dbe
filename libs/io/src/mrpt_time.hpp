#pragma once

#include <mrpt/core/Clock.h>
#include <mrpt/system/datetime.h>

#include "vestibule/core/time.hpp"

namespace vestibule::io {

/// mrpt::Clock counts 100 ns ticks from 1601-01-01; this many of them lie before 1970.
constexpr std::int64_t kTicksBeforeUnix = 116444736LL * 1000000000LL;

/// Zero for MRPT's "invalid" stamp and for ticks that cannot be a time (damaged files).
[[nodiscard]] inline Timestamp fromMrpt(mrpt::Clock::time_point t) {
  constexpr std::int64_t kLimit_ticks = 46'000'000'000'000'000;
  const std::int64_t ticks = t.time_since_epoch().count();
  if (t == INVALID_TIMESTAMP || ticks < kTicksBeforeUnix - kLimit_ticks ||
      ticks > kTicksBeforeUnix + kLimit_ticks) {
    return {};
  }
  return {(ticks - kTicksBeforeUnix) * 100};
}

/// Rounded to 100 ns.
[[nodiscard]] inline mrpt::Clock::time_point toMrpt(Timestamp t) {
  const std::int64_t ticks = t.ns >= 0 ? (t.ns + 50) / 100 : -((-t.ns + 50) / 100);
  return mrpt::Clock::time_point(mrpt::Clock::duration(ticks + kTicksBeforeUnix));
}

}  // namespace vestibule::io
