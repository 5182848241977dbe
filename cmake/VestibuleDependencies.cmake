# Everything comes from Debian 12; the package list is in cmake/apt-packages.txt.
foreach(component IN ITEMS math poses random maps obs slam nav io serialization bayes)
  find_package(mrpt-${component} 2.5 REQUIRED)
endforeach()
find_package(MPI REQUIRED COMPONENTS C)
find_package(yaml-cpp REQUIRED)
find_package(tinyxml2 REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(ZLIB REQUIRED)
find_package(BZip2 REQUIRED)
find_package(SQLite3 REQUIRED)

# Debian keeps OpenCV's CMake files in the 500 MB metapackage; three modules are all we need.
find_path(OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
foreach(component IN ITEMS core imgproc imgcodecs)
  find_library(OPENCV_${component}_LIBRARY opencv_${component} REQUIRED)
  add_library(vestibule_opencv_${component} SHARED IMPORTED)
  set_target_properties(
    vestibule_opencv_${component}
    PROPERTIES IMPORTED_LOCATION ${OPENCV_${component}_LIBRARY}
               INTERFACE_INCLUDE_DIRECTORIES ${OPENCV_INCLUDE_DIR})
endforeach()
add_library(vestibule_opencv INTERFACE)
target_link_libraries(
  vestibule_opencv INTERFACE vestibule_opencv_core vestibule_opencv_imgproc vestibule_opencv_imgcodecs)

find_path(GEOGRAPHICLIB_INCLUDE_DIR GeographicLib/LocalCartesian.hpp REQUIRED)
find_library(GEOGRAPHICLIB_LIBRARY NAMES GeographicLib Geographic REQUIRED)
add_library(vestibule_geographiclib SHARED IMPORTED)
set_target_properties(
  vestibule_geographiclib PROPERTIES IMPORTED_LOCATION ${GEOGRAPHICLIB_LIBRARY}
                                     INTERFACE_INCLUDE_DIRECTORIES ${GEOGRAPHICLIB_INCLUDE_DIR})

# Debian's rosbag_storage CMake package wants ROS 2 tools that it does not depend on: link by name.
add_library(vestibule_rosbag INTERFACE)
foreach(component IN ITEMS rosbag_storage rostime roscpp_serialization cpp_common console_bridge boost_regex)
  find_library(ROSBAG_${component}_LIBRARY ${component} REQUIRED)
  target_link_libraries(vestibule_rosbag INTERFACE ${ROSBAG_${component}_LIBRARY})
endforeach()
foreach(folder IN ITEMS pluginlib class_loader ament_index_cpp rcutils rcpputils)
  target_include_directories(vestibule_rosbag SYSTEM INTERFACE /usr/include/${folder})
endforeach()

# Debian splits NLopt in a C and a C++ package whose CMake files carry one name.
find_path(NLOPT_INCLUDE_DIR nlopt.hpp REQUIRED)
find_library(NLOPT_LIBRARY nlopt_cxx REQUIRED)
add_library(vestibule_nlopt SHARED IMPORTED)
set_target_properties(
  vestibule_nlopt PROPERTIES IMPORTED_LOCATION ${NLOPT_LIBRARY}
                             INTERFACE_INCLUDE_DIRECTORIES ${NLOPT_INCLUDE_DIR})

find_package(sdformat12 REQUIRED)
add_library(vestibule_sdformat ALIAS sdformat12::sdformat12)

if(VESTIBULE_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
endif()
if(VESTIBULE_BENCH)
  find_package(benchmark REQUIRED)
endif()
