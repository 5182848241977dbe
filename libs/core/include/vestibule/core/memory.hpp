#pragma once

namespace vestibule {

/// Gives freed memory back to the system where the C library would keep it for later. Call it
/// between two phases of a run that need much memory each.
void giveBackFreedMemory();

/// From now on freed blocks of 128 KiB and more go back to the system at once, instead of waiting
/// for something of the same size.
void giveBackFreedBlocks();

/// Gives back the pages of shared libraries that were touched to load them: symbol tables and
/// code around what ran so far. What is needed again comes back from the file cache, page by page.
/// A debugger's breakpoints inside libraries go with them; those in the program itself stay.
void giveBackLibraryPages();

}  // namespace vestibule
