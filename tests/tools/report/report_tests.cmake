# Tests of the report page: in C++, and in a browser.
add_executable(report_sample
  report/report_sample.cpp
  report/synthetic_report.cpp)
target_link_libraries(report_sample PRIVATE stageid::tools fmt::fmt nlohmann_json::nlohmann_json
  stageid::warnings)

find_package(Python3 3.9 COMPONENTS Interpreter)
if(Python3_Interpreter_FOUND)
  foreach(kind full full_compared small compared bare hostile)
    add_test(NAME report_in_browser.${kind}
      COMMAND Python3::Interpreter ${CMAKE_CURRENT_LIST_DIR}/check_report.py
        --sample $<TARGET_FILE:report_sample> --work ${CMAKE_CURRENT_BINARY_DIR}/report_in_browser
        --kind ${kind})
    # 77: no browser on this machine and STAGEID_REQUIRE_BROWSER not set.
    set_tests_properties(report_in_browser.${kind} PROPERTIES
      SKIP_RETURN_CODE 77 LABELS "tools;browser" TIMEOUT 1800)
  endforeach()
  foreach(what motion print size)
    add_test(NAME report_in_${what}
      COMMAND Python3::Interpreter ${CMAKE_CURRENT_LIST_DIR}/check_${what}.py
        --sample $<TARGET_FILE:report_sample> --work ${CMAKE_CURRENT_BINARY_DIR}/report_in_${what})
    set_tests_properties(report_in_${what} PROPERTIES SKIP_RETURN_CODE 77 LABELS "tools;browser" TIMEOUT 600)
  endforeach()
endif()
