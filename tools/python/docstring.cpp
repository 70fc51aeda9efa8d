#include "tools/python/docstring.hpp"

#include <stdexcept>
#include <string>

namespace stageid {

const char* docstring(std::string_view name) {
  for (const Docstring& documented : docstrings())
    if (documented.name == name) return documented.text;
  throw std::logic_error("the stub has no docstring of " + std::string(name));
}

}  // namespace stageid
