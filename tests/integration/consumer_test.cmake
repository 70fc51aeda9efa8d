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

# The program of docs/cpp.md, on a log that the installed program wrote.
run(${WORK_DIR}/prefix/bin/stageid run ${WORK_DIR}/prefix/share/stageid/configs/experiment/small_stage.yaml
  -o ${WORK_DIR}/run.slog)
execute_process(COMMAND ${WORK_DIR}/build/hello WORKING_DIRECTORY ${WORK_DIR}
  OUTPUT_VARIABLE modes COMMAND_ERROR_IS_FATAL ANY)
if(NOT modes MATCHES "Hz, damping ratio")
  message(FATAL_ERROR "hello printed no mode: ${modes}")
endif()
file(READ ${CONSUMER_DIR}/hello.cpp hello)
file(READ ${CONSUMER_DIR}/../../docs/cpp.md page)
string(FIND "${page}" "${hello}" at)
if(at EQUAL -1)
  message(FATAL_ERROR "docs/cpp.md does not show tests/consumer/hello.cpp")
endif()

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
