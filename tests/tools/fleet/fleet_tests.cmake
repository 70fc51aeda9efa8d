# Tests of the fleet: in C++, and its page in a browser.
add_test(NAME fleet_in_browser
  COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/check_fleet.py
    $<TARGET_FILE:stageid_program> ${PROJECT_SOURCE_DIR}/configs ${CMAKE_CURRENT_BINARY_DIR}/fleet_in_browser)
set_tests_properties(fleet_in_browser PROPERTIES SKIP_RETURN_CODE 77 LABELS "tools;browser" TIMEOUT 300)
