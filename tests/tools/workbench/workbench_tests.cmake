# Tests of the workbench in a browser, and against hostile requests.
add_test(NAME workbench_in_browser
  COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/check_workbench.py
    $<TARGET_FILE:stageid_program> ${PROJECT_SOURCE_DIR}/configs ${PROJECT_SOURCE_DIR}/docs/guide.md
    ${CMAKE_CURRENT_BINARY_DIR}/workbench_in_browser)
set_tests_properties(workbench_in_browser PROPERTIES SKIP_RETURN_CODE 77 LABELS "tools;browser" TIMEOUT 600)
add_test(NAME workbench_hostile_requests
  COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/hostile_requests.py
    $<TARGET_FILE:stageid_program> ${PROJECT_SOURCE_DIR}/configs ${CMAKE_CURRENT_BINARY_DIR}/workbench_hostile)
set_tests_properties(workbench_hostile_requests PROPERTIES LABELS tools TIMEOUT 300)
