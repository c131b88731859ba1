// Whole-file writes that never leave a truncated file: written aside as `<path>.*part`, synced, renamed.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace graupel {

/// Where a path leads when it is a link, or one to a link.
struct LinkTarget {
  std::string path;        ///< the path itself where it is no link
  bool open_file = false;  ///< a link of the system to what a process has open, as /dev/stdout
};
/// Throws IoError for links in a circle.
LinkTarget follow_links(const std::string& path);

/// Writes `bytes` to `path`; throws IoError naming path, system error and size (disk full, no permission).
/// Several processes may write one path at once: the last whole file stays. "-" is standard output; a target that
/// exists and is not a regular file (/dev/null, a pipe) is written directly. Of a link the file that it names is
/// written.
void write_file_atomically(const std::string& path, std::string_view bytes);
/// The same for bytes that lie in several places.
void write_file_atomically(const std::string& path, const std::vector<std::string_view>& pieces);

/// Waits until what was written to `path` is on the disk; throws IoError.
void sync_file(const std::string& path);

/// Renames `part` to `path`, which it replaces, and waits until the folder is on the disk; throws IoError.
void replace_file(const std::string& part, const std::string& path);

/// fsync of `path`.part, rename to `path` or to what this links to, fsync of the folder: the last step of any streamed
/// writer.
void finish_part_file(const std::string& path);

/// For files that another library writes: write(`path`.part), then finish_part_file. Where that fails, the part file is
/// removed, and the library's exception becomes an IoError.
void write_part_file(const std::string& path, const std::function<void(const std::string& part)>& write);

/// Reads a whole file; throws InputError when it is missing, unreadable or larger than `limit` bytes.
std::string read_file(const std::string& path, std::size_t limit = std::size_t(1) << 31);

/// Creates a folder and its parents; throws IoError.
void make_folder(const std::string& path);

/// Names in a folder, sorted, without "." and ".."; empty when it is no folder.
std::vector<std::string> names_in(const std::string& folder);

/// Removes a file or a folder with all it holds; links are removed, not followed. A path that is not there is fine;
/// what cannot be removed stays. Plain system calls: PyTorch's libraries export an older std::filesystem, whose
/// remove_all crashes when it replaces ours.
void remove_path(const std::string& path);

}  // namespace graupel
