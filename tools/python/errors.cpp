// What the libraries throw, as Python's own kinds of errors.

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#include "acquisition/files/file_error.hpp"
#include "hal/stage/stage.hpp"
#include "tools/python/bindings.hpp"
#include "tools/terminal/exit_code.hpp"

namespace stageid {
namespace {

// Borrowed from the module, which lives as long as the interpreter.
PyObject* file_error = nullptr;
PyObject* format_error = nullptr;
PyObject* request_error = nullptr;
PyObject* stage_error = nullptr;

PyObject* new_error(py::module_& module, const char* name, const py::tuple& bases) {
  const auto type = py::reinterpret_steal<py::object>(PyErr_NewExceptionWithDoc(
      (std::string("stageid.") + name).c_str(), docstring(name), bases.ptr(), nullptr));
  if (!type) throw py::error_already_set();
  module.attr(name) = type;
  return type.ptr();
}

/// Messages quote what stands in files, which need not be UTF-8.
void raise(PyObject* type, const std::exception& error) {
  const std::string_view what = error.what();
  const auto text = py::reinterpret_steal<py::object>(
      PyUnicode_DecodeUTF8(what.data(), static_cast<Py_ssize_t>(what.size()), "backslashreplace"));
  if (text) PyErr_SetObject(type, text.ptr());
}

void translate(std::exception_ptr thrown) {
  if (!thrown) return;
  try {
    std::rethrow_exception(thrown);
  } catch (const Interrupted&) {
    PyErr_SetNone(PyExc_KeyboardInterrupt);
  } catch (const FormatError& error) {
    raise(format_error, error);
  } catch (const FileError& error) {
    raise(file_error, error);
  } catch (const StageError& error) {
    raise(stage_error, error);
  } catch (const std::filesystem::filesystem_error& error) {
    raise(file_error, error);
  } catch (const std::invalid_argument& error) {
    raise(request_error, error);
  }
}

}  // namespace

void define_errors(py::module_& module) {
  const py::handle base =
      new_error(module, "StageidError", py::make_tuple(py::handle(PyExc_Exception)));
  const auto derived = [&](const char* name, PyObject* kind) {
    return new_error(module, name, py::make_tuple(base, py::handle(kind)));
  };
  request_error = derived("RequestError", PyExc_ValueError);
  format_error = derived("FormatError", PyExc_ValueError);
  file_error = derived("FileError", PyExc_OSError);
  stage_error = derived("StageError", PyExc_RuntimeError);
  py::register_local_exception_translator(&translate);
}

}  // namespace stageid
