# Installs the build into a fresh prefix and builds tests/consumer against that package.
#   cmake -DBUILD_DIR=... -DCONSUMER_DIR=... -DWORK_DIR=... -DFLAGS=... -P consumer_test.cmake
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK_DIR})

# run(<command> ...): stops the test where a step fails.
macro(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endmacro()

run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/prefix)
run(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${WORK_DIR}/build -G Ninja -DCMAKE_BUILD_TYPE=Release
  -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix "-DCMAKE_CXX_FLAGS=${FLAGS}")
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build/consumer)

# The program and what it needs are installed with it.
run(${WORK_DIR}/prefix/bin/stageid --version)
file(GLOB configs ${WORK_DIR}/prefix/share/stageid/configs/*/*.yaml)
if(NOT configs)
  message(FATAL_ERROR "no configuration was installed")
endif()
foreach(file man/man1/stageid.1.gz man/man1/stageid-frf.1.gz bash-completion/completions/stageid
    zsh/vendor-completions/_stageid)
  if(NOT EXISTS ${WORK_DIR}/prefix/share/${file})
    message(FATAL_ERROR "share/${file} was not installed")
  endif()
endforeach()
