# The pages of report and dashboard: sources of ours and the plot library, built into stageid_tools.
find_path(STAGEID_DYGRAPHS_DIR dygraph.min.js
  PATHS /usr/share/javascript/dygraphs /usr/local/share/javascript/dygraphs NO_DEFAULT_PATH
  DOC "Folder of dygraph.min.js")
if(NOT STAGEID_DYGRAPHS_DIR)
  message(FATAL_ERROR "The plot library of the report, dygraphs, was not found. Install it with\n"
    "  apt-get install libjs-dygraphs\n"
    "or set STAGEID_DYGRAPHS_DIR to the folder that holds dygraph.min.js.")
endif()

# What draws a response; the dashboard draws with the same pieces.
set(response_js
  decode
  channels
  format
  theme
  axes
  band
  svg
  figure
  matrix
  matrix_use
  entry
  entry_table
  nyquist
  cmif
  timing)
set(report_js
  data
  ${response_js}
  cost
  tables
  plate
  shapes
  shape_scene
  mac
  compare
  stabilization
  nonlinearity
  interpolation
  health
  selftest
  main)
list(TRANSFORM report_js REPLACE "(.+)" "${CMAKE_CURRENT_LIST_DIR}/js/\\1.js")
set(dashboard_dir ${CMAKE_CURRENT_LIST_DIR}/../dashboard)
set(dashboard_js ${response_js})
list(TRANSFORM dashboard_js REPLACE "(.+)" "${CMAKE_CURRENT_LIST_DIR}/js/\\1.js")
list(PREPEND dashboard_js ${dashboard_dir}/js/data.js)
foreach(name progress levels events response main)
  list(APPEND dashboard_js ${dashboard_dir}/js/${name}.js)
endforeach()
set(library_js ${STAGEID_DYGRAPHS_DIR}/dygraph.min.js)
set(report_single page.html report.css dygraphs_licence.txt embed.cmake)
list(TRANSFORM report_single PREPEND "${CMAKE_CURRENT_LIST_DIR}/")
list(APPEND report_single ${dashboard_dir}/page.html ${dashboard_dir}/dashboard.css)

string(REPLACE ";" "|" report_js_joined "${report_js}")
string(REPLACE ";" "|" dashboard_js_joined "${dashboard_js}")
string(REPLACE ";" "|" library_js_joined "${library_js}")
set(report_assets
  page_html=${CMAKE_CURRENT_LIST_DIR}/page.html
  page_css=${CMAKE_CURRENT_LIST_DIR}/report.css
  page_js=${report_js_joined}
  dashboard_html=${dashboard_dir}/page.html
  dashboard_css=${dashboard_dir}/dashboard.css
  dashboard_js=${dashboard_js_joined}
  library_css=${STAGEID_DYGRAPHS_DIR}/dygraph.min.css
  library_js=${library_js_joined}
  library_licence=${CMAKE_CURRENT_LIST_DIR}/dygraphs_licence.txt)
string(REPLACE ";" "," report_assets "${report_assets}")

set(report_assets_cpp ${CMAKE_CURRENT_BINARY_DIR}/report_assets.cpp)
add_custom_command(OUTPUT ${report_assets_cpp}
  COMMAND ${CMAKE_COMMAND} -DOUTPUT=${report_assets_cpp} "-DASSETS=${report_assets}"
    -P ${CMAKE_CURRENT_LIST_DIR}/embed.cmake
  DEPENDS ${report_js} ${dashboard_js} ${library_js} ${report_single} ${STAGEID_DYGRAPHS_DIR}/dygraph.min.css
  COMMENT "Embedding the report page" VERBATIM)

target_sources(stageid_tools PRIVATE
  report.cpp
  report_comparison.cpp
  report_diagrams.cpp
  report_encoding.cpp
  report_json.cpp
  report_modes.cpp
  report_packing.cpp
  report_shapes.cpp
  report_uncertainty.cpp
  report_verdict.cpp
  ${report_assets_cpp})
