# vestibule_module(<name> SOURCES ... [PUBLIC_LINKS ...] [PRIVATE_LINKS ...])
# A static library vestibule_<name>, alias vestibule::<name>, headers in include/.
function(vestibule_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC_LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(vestibule_${name} STATIC ${ARG_SOURCES})
  add_library(vestibule::${name} ALIAS vestibule_${name})
  target_include_directories(vestibule_${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include)
  target_link_libraries(
    vestibule_${name}
    PUBLIC ${ARG_PUBLIC_LINKS}
    PRIVATE vestibule::options ${ARG_PRIVATE_LINKS})
endfunction()

# vestibule_small_matrices(<module>)
# Without the inline `rep stos` and `rep movs` that generic tuning clears and copies small matrices
# by: linearising a step of the filter takes 0.75 times as long. Neither flag changes a result.
function(vestibule_small_matrices name)
  target_compile_options(vestibule_${name} PRIVATE -fno-math-errno)
  if(CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
    target_compile_options(vestibule_${name} PRIVATE -mtune=haswell)
  endif()
endfunction()

# vestibule_test(<name> SOURCES ... LINKS ... [LABELS unit] [TIMEOUT s])
# One GoogleTest binary; every TEST becomes one CTest entry.
function(vestibule_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LINKS;LABELS" ${ARGN})
  if(NOT VESTIBULE_TESTS)
    return()
  endif()
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} vestibule::options GTest::gmock GTest::gtest_main)
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR}/tests/support)
  target_compile_definitions(${name} PRIVATE VESTIBULE_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
  gtest_discover_tests(
    ${name}
    DISCOVERY_MODE PRE_TEST
    PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
endfunction()

# vestibule_bench(<name> SOURCES ... LINKS ...): a Google Benchmark binary, built with the preset
# "bench" only; run build/bench/bin/<name>.
function(vestibule_bench name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  if(NOT VESTIBULE_BENCH)
    return()
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} vestibule::options benchmark::benchmark)
endfunction()
