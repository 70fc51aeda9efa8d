# Compresses man pages as required by Debian, without time stamps and names.
#   cmake -DFROM=DIR -DTO=DIR -DGZIP=PROGRAM -P pack_manual.cmake
file(REMOVE_RECURSE ${TO})
file(MAKE_DIRECTORY ${TO})
file(GLOB pages ${FROM}/*.1)
foreach(page IN LISTS pages)
  cmake_path(GET page FILENAME name)
  execute_process(COMMAND ${GZIP} -9nc ${page} OUTPUT_FILE ${TO}/${name}.gz COMMAND_ERROR_IS_FATAL ANY)
endforeach()
