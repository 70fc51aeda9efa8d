# The Python package: as the program, its display, its errors, its stub.
foreach(script module display errors pickle stub)
  add_test(NAME tools.python_${script}
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/${script}_test.py
      $<TARGET_FILE:stageid_program> ${PROJECT_BINARY_DIR}/tools/python
      ${PROJECT_SOURCE_DIR}/configs/experiment/small_stage.yaml
      ${CMAKE_CURRENT_BINARY_DIR}/python_${script})
  set_tests_properties(tools.python_${script} PROPERTIES LABELS "tools;python" TIMEOUT 300)
endforeach()

# The examples, as a reader runs them: from the root of the sources.
file(GLOB examples CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/docs/examples/*.py)
foreach(example IN LISTS examples)
  cmake_path(GET example STEM name)
  add_test(NAME tools.example_${name} COMMAND /usr/bin/python3 ${example}
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(tools.example_${name} PROPERTIES LABELS "tools;python" TIMEOUT 300
    ENVIRONMENT PYTHONPATH=${PROJECT_BINARY_DIR}/tools/python)
endforeach()

# Types of the stub, and that the examples keep to them.
find_program(STAGEID_MYPY mypy PATHS /usr/bin NO_DEFAULT_PATH)
if(STAGEID_MYPY)
  list(TRANSFORM examples PREPEND ${PROJECT_SOURCE_DIR}/ OUTPUT_VARIABLE example_files)
  add_test(NAME tools.python_types
    COMMAND ${STAGEID_MYPY} --config-file ${CMAKE_CURRENT_LIST_DIR}/mypy.ini
      --python-executable /usr/bin/python3 --cache-dir ${CMAKE_CURRENT_BINARY_DIR}/mypy_cache
      ${PROJECT_SOURCE_DIR}/tools/python/stageid/__init__.pyi
      ${PROJECT_SOURCE_DIR}/tools/python/stageid/_conversions.py
      ${PROJECT_SOURCE_DIR}/tools/python/stageid/_display.py
      ${PROJECT_SOURCE_DIR}/tools/python/stageid/_results.py ${example_files})
  set_tests_properties(tools.python_types PROPERTIES LABELS "tools;python" TIMEOUT 300
    ENVIRONMENT MYPYPATH=${PROJECT_SOURCE_DIR}/tools/python)
endif()
