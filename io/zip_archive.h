// Zip archives through libzip: members that are stored or deflated.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace graupel::io {

/// An archive that is open for reading.
class ZipReader {
 public:
  /// Throws InputError for a missing, damaged, truncated or empty archive.
  explicit ZipReader(const std::string& path);
  ~ZipReader();
  ZipReader(ZipReader&&) noexcept;
  /// Names of the members, in the archive's order.
  const std::vector<std::string>& names() const;
  /// The bytes of a member, its checksum verified. Throws InputError for a member that is damaged, encrypted, packed
  /// in another way, or claims more bytes than it can unfold to.
  std::string read(std::size_t member) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes an archive; `bytes_of(i)` gives the bytes of member i when they are needed, one after another, and may throw.
/// The same members give the same bytes. Throws IoError; what is at `path` then is of no use.
void write_zip(const std::string& path, const std::vector<std::string>& names,
               const std::function<std::string(std::size_t)>& bytes_of);

}  // namespace graupel::io
