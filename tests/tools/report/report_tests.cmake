# Tests of the report page: in C++, and in a browser.
add_library(synthetic_report STATIC report/synthetic_report.cpp)
target_link_libraries(synthetic_report PUBLIC stageid::tools nlohmann_json::nlohmann_json
  PRIVATE fmt::fmt stageid::warnings)
target_precompile_headers(synthetic_report REUSE_FROM stageid_precompiled_tools)
add_executable(report_sample report/report_sample.cpp)
target_link_libraries(report_sample PRIVATE synthetic_report stageid::warnings)
# The precompiled headers of the tests are used as they were compiled.
target_compile_options(report_sample PRIVATE $<TARGET_PROPERTY:GTest::gtest,INTERFACE_COMPILE_OPTIONS>)
target_precompile_headers(report_sample REUSE_FROM stageid_precompiled_tests)

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
