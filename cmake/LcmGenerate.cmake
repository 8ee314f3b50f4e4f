# LCM's Debian package ships only a pkg-config file, so the generator is called here by hand.

find_package(PkgConfig REQUIRED)
pkg_check_modules(LCM REQUIRED IMPORTED_TARGET GLOBAL lcm)
find_program(LCM_GEN lcm-gen REQUIRED)

# lcm_generate_cpp(TARGET TYPES file.lcm...)
#
# An interface target whose include directory holds <package>/<type>.hpp for every .lcm file given. The generated
# headers are SYSTEM: they are not held to the project's warnings. An lcm-gen of another version gives other text but
# the same fingerprints.
function(lcm_generate_cpp target)
  cmake_parse_arguments(ARG "" "" "TYPES" ${ARGN})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/generated)
  set(headers "")
  foreach(type ${ARG_TYPES})
    get_filename_component(stem ${type} NAME_WE)
    set(header ${out}/vantage/${stem}.hpp)
    add_custom_command(
      OUTPUT ${header}
      COMMAND ${LCM_GEN} --cpp --cpp-hpath ${out} ${CMAKE_CURRENT_SOURCE_DIR}/${type}
      DEPENDS ${type}
      COMMENT "lcm-gen ${type}"
      VERBATIM)
    list(APPEND headers ${header})
  endforeach()
  add_custom_target(${target}_headers DEPENDS ${headers})
  add_library(${target} INTERFACE)
  target_include_directories(${target} SYSTEM INTERFACE ${out})
  target_link_libraries(${target} INTERFACE PkgConfig::LCM)
  add_dependencies(${target} ${target}_headers)
endfunction()
