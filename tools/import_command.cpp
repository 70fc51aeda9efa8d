#include "tools/import_command.hpp"

#include <stdexcept>

#include "tools/command_line.hpp"

namespace stageid {

void add_import_command(CLI::App& app) {
  CLI::App* command = add_command(app, "import", "");
  command->group("");
  // Whatever follows: the answer is the same. Falling through, extras would be refused by the program.
  command->allow_extras();
  command->fallthrough(false);
  command->final_callback([] {
    throw std::invalid_argument(
        "import: not in this version; logs and FRFs in stageid's HDF5 layout are read directly by "
        "every "
        "command");
  });
}

}  // namespace stageid
