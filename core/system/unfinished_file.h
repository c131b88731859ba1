// Files that are of no use before they are whole: removed where the work on them ends early, by an error or a signal.
#pragma once

#include <string>

namespace graupel {

class UnfinishedFile {
 public:
  /// Of the file `path`, which need not be there yet.
  explicit UnfinishedFile(std::string path);
  /// Removes the file unless keep() was called.
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

  const std::string& path() const { return path_; }
  /// It is whole, or has another name now.
  void keep();

 private:
  std::string path_;
  int slot_;  ///< of the list that remove_unfinished_files() goes through; -1 where that is full
};

/// Removes the files of all that live. For a signal handler that ends the process: plain system calls alone.
void remove_unfinished_files();

}  // namespace graupel
