// Errors of a stage file about a library. integration.plugin tests a real library with another process.

#include "hal/plugin/plugin_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stageid {
namespace test_plugin_stage {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(PluginStage, NamesALibraryThatIsNotThere) {
  EXPECT_THAT(
      [] {
        PluginStage({}, {"/nowhere/stage.so", {}}, 0.0);
      },
      ThrowsMessage<StageError>(HasSubstr("/nowhere/stage.so: cannot be loaded")));
}

TEST(PluginStage, RefusesALibraryWithoutTheInterface) {
  EXPECT_THAT(
      [] {
        PluginStage({}, {"libm.so.6", {}}, 0.0);
      },
      ThrowsMessage<StageError>(HasSubstr("cannot be loaded")))
      << "not looked for in the system's folders";
  EXPECT_THAT(
      [] {
        PluginStage({}, {"/lib/x86_64-linux-gnu/libm.so.6", {}}, 0.0);
      },
      ThrowsMessage<StageError>(HasSubstr("has no function stageid_get_backend()")));
}

}  // namespace test_plugin_stage
}  // namespace stageid
