// Graupel's errors as Python's: by kind, with the program's messages.
#include "core/system/error.h"

#include "core/system/printable.h"
#include "library/python/files.h"

namespace graupel::python {

namespace {

const char* class_of(ExitCode code) {
  switch (code) {
    case ExitCode::usage:
      return "ConfigError";
    case ExitCode::bad_input:
      return "InputError";
    case ExitCode::diverged:
      return "DivergedError";
    case ExitCode::io:
      return "IoError";
    default:
      return "Error";
  }
}

}  // namespace

void register_errors() {
  nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
    try {
      std::rethrow_exception(thrown);
    } catch (const Error& error) {
      const nb::object type = nb::module_::import_("graupel._errors").attr(class_of(error.code()));
      PyErr_SetObject(type.ptr(), text_of(shortened_message(error.what())).ptr());  // file names need not be UTF-8
    }
  });
}

}  // namespace graupel::python
