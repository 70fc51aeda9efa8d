# Debian packages by `cpack`, and a wheel by the target `wheel`: docs/decisions/packages.md.
#
# Components: program (stageid), python (python3-stageid); Unspecified is the development files for C++
# (libstageid-dev).

set(doc_dir ${CMAKE_INSTALL_DATADIR}/doc)
# Compressed without a time stamp: the changelog of the program, and the one of this first Debian revision.
set(STAGEID_PACKAGE_CONTACT "stageid maintainers <stageid@packages.example>" CACHE STRING
  "Whom the Debian packages name as maintainer: NAME <ADDRESS>")
set(debian_revision 1)
string(TIMESTAMP changelog_date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH if set
configure_file(${CMAKE_CURRENT_LIST_DIR}/changelog.Debian.in ${CMAKE_CURRENT_BINARY_DIR}/changelog.Debian @ONLY)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/CHANGELOG.md)
set(changelogs)
foreach(file ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${CMAKE_CURRENT_BINARY_DIR}/changelog.Debian)
  cmake_path(GET file FILENAME name)
  string(REPLACE "CHANGELOG.md" "changelog" name ${name})
  set(packed ${CMAKE_CURRENT_BINARY_DIR}/${name}.gz)
  execute_process(COMMAND ${STAGEID_GZIP} -9nc ${file} OUTPUT_FILE ${packed} COMMAND_ERROR_IS_FATAL ANY)
  list(APPEND changelogs ${packed})
endforeach()
set(documents ${CMAKE_CURRENT_LIST_DIR}/copyright ${changelogs})
install(FILES ${documents} DESTINATION ${doc_dir}/stageid COMPONENT program)
install(FILES ${documents} DESTINATION ${doc_dir}/libstageid-dev)

set(components program Unspecified)
if(TARGET stageid_mpi)
  list(APPEND components mpi)
  install(TARGETS stageid_mpi RUNTIME COMPONENT mpi)
  # The manual is that of stageid.
  set(mpi_manual ${CMAKE_CURRENT_BINARY_DIR}/stageid-mpi.1)
  file(WRITE ${mpi_manual} ".so man1/stageid.1\n")
  execute_process(COMMAND ${STAGEID_GZIP} -9nc ${mpi_manual} OUTPUT_FILE ${mpi_manual}.gz COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${mpi_manual}.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT mpi)
  install(FILES ${documents} DESTINATION ${doc_dir}/stageid-mpi COMPONENT mpi)
endif()
if(STAGEID_BUILD_PYTHON)
  list(APPEND components python)
  # The search path of Debian's python3 for any minor version.
  set(package_dir lib/python3/dist-packages/stageid)
  install(TARGETS stageid_python LIBRARY DESTINATION ${package_dir} COMPONENT python)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/tools/python/stageid/ DESTINATION ${package_dir} COMPONENT python
    FILES_MATCHING PATTERN *.py PATTERN *.pyi PATTERN py.typed PATTERN __pycache__ EXCLUDE)
  install(FILES ${documents} DESTINATION ${doc_dir}/python3-stageid COMPONENT python)

  add_custom_target(wheel
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/wheel.py
      ${PROJECT_BINARY_DIR}/tools/python/stageid ${PROJECT_VERSION} ${PROJECT_BINARY_DIR}
      --licence ${CMAKE_CURRENT_LIST_DIR}/copyright --readme ${PROJECT_SOURCE_DIR}/docs/python.md
      --strip ${CMAKE_STRIP}
    DEPENDS stageid_python VERBATIM)
endif()

add_custom_target(sbom
  COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/sbom.py $<TARGET_FILE:stageid_program> ${PROJECT_BINARY_DIR}
    ${PROJECT_VERSION} ${PROJECT_BINARY_DIR}/stageid-${PROJECT_VERSION}.spdx.json
  DEPENDS stageid_program VERBATIM)

set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL ${components})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_PACKAGE_NAME stageid)
set(CPACK_PACKAGE_VENDOR stageid)
set(CPACK_PACKAGE_CONTACT "${STAGEID_PACKAGE_CONTACT}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE ${debian_revision})
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME stageid)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
  "The program: from an experiment file to a continuous-time modal model with
standard deviations; excitation, measurement, frequency response, fit, report.")
set(CPACK_DEBIAN_MPI_PACKAGE_NAME stageid-mpi)
set(CPACK_DEBIAN_MPI_PACKAGE_DEPENDS "stageid (= ${PROJECT_VERSION}-${debian_revision}), openmpi-bin")
set(CPACK_COMPONENT_MPI_DESCRIPTION
  "The program for MPI: many processes, also of several machines, divide the work
of one frequency response, fit or validation. The results are those of stageid.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-stageid)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
  "python3 (>= 3.11), python3 (<< 3.12), python3-numpy")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION 
  "The Python package: simulation, frequency responses, modal models and state
space as functions with numpy arrays in and out.")
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME libstageid-dev)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_DEPENDS
  "libeigen3-dev, libfmt-dev, nlohmann-json3-dev, libfftw3-dev, libhdf5-dev, libmodbus-dev, libzmq3-dev, libxxhash-dev")
set(CPACK_COMPONENT_UNSPECIFIED_DESCRIPTION 
  "Static libraries and headers: what find_package(stageid) gives to C++ programs.")
include(CPack)
