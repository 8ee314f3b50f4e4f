# Finds single OpenCV modules as Debian packages them (libopencv-core-dev, ...), and makes the targets opencv_<module>.
#
# OpenCV's own config file comes with libopencv-dev alone, which drags in VTK, the GUI and the other modules,
# some 40 packages that are not used here. Where it is present it is used.
find_package(OpenCV QUIET NO_MODULE)
if(OpenCV_FOUND)
  return()
endif()

find_path(OpenCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
set(_opencv_required OpenCV_INCLUDE_DIR)
foreach(_module IN LISTS OpenCV_FIND_COMPONENTS)
  find_library(OpenCV_${_module}_LIBRARY opencv_${_module})
  list(APPEND _opencv_required OpenCV_${_module}_LIBRARY)
  if(OpenCV_${_module}_LIBRARY AND NOT TARGET opencv_${_module})
    add_library(opencv_${_module} SHARED IMPORTED GLOBAL)
    set_target_properties(opencv_${_module} PROPERTIES
      IMPORTED_LOCATION ${OpenCV_${_module}_LIBRARY}
      INTERFACE_INCLUDE_DIRECTORIES ${OpenCV_INCLUDE_DIR})
    # Every module but core itself needs core.
    if(NOT _module STREQUAL "core" AND TARGET opencv_core)
      set_property(TARGET opencv_${_module} PROPERTY INTERFACE_LINK_LIBRARIES opencv_core)
    endif()
  endif()
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenCV REQUIRED_VARS ${_opencv_required})
