#pragma once

#include <malloc.h>

namespace vestibule {

/// Gives freed memory back to the system where the C library would keep it for later. Call it
/// between two phases of a run that need much memory each.
inline void giveBackFreedMemory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace vestibule
