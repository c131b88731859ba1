// What a decoder of bytes found wrong, without the file's name.
#pragma once

#include <stdexcept>

namespace graupel::io {

/// Bytes that are damaged, cut short or refused. Readers of files turn it into InputError with file and member.
struct Unreadable : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace graupel::io
