// Errors of a stage file about a library. integration.plugin tests a real library with another process.

#include "hal/plugin/plugin_stage.hpp"

#include <gtest/gtest.h>

#include "tests/hal/stage_bench.hpp"

namespace stageid::test_plugin_stage {

auto loading(const char* library) {
  return [library] { const PluginStage stage({}, {library, {}}, 0.0); };
}

TEST(PluginStage, NamesALibraryThatIsNotThere) {
  EXPECT_THAT(loading("/nowhere/stage.so"), test::refuses("/nowhere/stage.so: cannot be loaded"));
}

TEST(PluginStage, RefusesALibraryWithoutTheInterface) {
  EXPECT_THAT(loading("libm.so.6"), test::refuses("cannot be loaded"))
      << "not looked for in the system's folders";
  EXPECT_THAT(loading("/lib/x86_64-linux-gnu/libm.so.6"),
              test::refuses("has no function stageid_get_backend()"));
}

}  // namespace stageid::test_plugin_stage
