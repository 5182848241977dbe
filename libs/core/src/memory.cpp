#include "vestibule/core/memory.hpp"

#include <cstddef>  // any header of the C library says which one it is

#ifdef __GLIBC__
#include <link.h>
#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>
#endif

namespace vestibule {

#ifdef __GLIBC__
namespace {

/// Code that the loader had to write to: its pages are not those of the file.
bool hasTextRelocations(const dl_phdr_info& library) {
  for (int i = 0; i < library.dlpi_phnum; ++i) {
    const auto& segment = library.dlpi_phdr[i];
    if (segment.p_type != PT_DYNAMIC) continue;
    const auto* entry =
        reinterpret_cast<const ElfW(Dyn)*>(library.dlpi_addr + segment.p_vaddr);  // as ld.so does
    for (; entry->d_tag != DT_NULL; ++entry) {
      if (entry->d_tag == DT_TEXTREL) return true;
      if (entry->d_tag == DT_FLAGS && (entry->d_un.d_val & DF_TEXTREL) != 0) return true;
    }
  }
  return false;
}

int giveBack(dl_phdr_info* library, std::size_t /*size*/, void* /*data*/) {
  const bool is_library = library->dlpi_name != nullptr && library->dlpi_name[0] == '/';
  if (!is_library || hasTextRelocations(*library)) return 0;
  const auto page = static_cast<ElfW(Addr)>(sysconf(_SC_PAGESIZE));
  for (int i = 0; i < library->dlpi_phnum; ++i) {
    const auto& segment = library->dlpi_phdr[i];
    if (segment.p_type != PT_LOAD || (segment.p_flags & PF_W) != 0) continue;
    // Whole pages only: a neighbour that was written to may share the last one.
    const ElfW(Addr) begin = (library->dlpi_addr + segment.p_vaddr + page - 1) / page * page;
    const ElfW(Addr) end = (library->dlpi_addr + segment.p_vaddr + segment.p_memsz) / page * page;
    if (begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTNEED);
  }
  return 0;
}

}  // namespace

void giveBackFreedMemory() { malloc_trim(0); }

void giveBackFreedBlocks() {
  constexpr int kLarge = 128 * 1024;
  mallopt(M_MMAP_THRESHOLD, kLarge);
  mallopt(M_TRIM_THRESHOLD, kLarge);
}

void giveBackLibraryPages() { dl_iterate_phdr(&giveBack, nullptr); }
#else
void giveBackFreedMemory() {}

void giveBackFreedBlocks() {}

void giveBackLibraryPages() {}
#endif

}  // namespace vestibule
