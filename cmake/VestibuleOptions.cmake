# One INTERFACE target carries warnings, sanitizers and assertions; no global flags.
add_library(vestibule_options INTERFACE)
add_library(vestibule::options ALIAS vestibule_options)

target_compile_options(
  vestibule_options
  INTERFACE -Wall
            -Wextra
            -Wpedantic
            -Wconversion
            -Wshadow
            -Wnon-virtual-dtor
            $<$<BOOL:${VESTIBULE_WERROR}>:-Werror>)

# x86-64 and AArch64 differ in contracting a*b+c into one rounding; results must not.
target_compile_options(vestibule_options INTERFACE -ffp-contract=off)

if(VESTIBULE_ASSERTIONS)
  target_compile_options(vestibule_options INTERFACE -UNDEBUG)
  target_compile_definitions(vestibule_options INTERFACE _GLIBCXX_ASSERTIONS)
endif()

if(VESTIBULE_SANITIZE)
  target_compile_options(vestibule_options INTERFACE -fsanitize=${VESTIBULE_SANITIZE} -fno-omit-frame-pointer)
  if(VESTIBULE_SANITIZE MATCHES "undefined")
    target_compile_options(vestibule_options INTERFACE -fno-sanitize-recover=undefined)
  endif()
  target_link_options(vestibule_options INTERFACE -fsanitize=${VESTIBULE_SANITIZE})
endif()
