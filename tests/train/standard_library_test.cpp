// The program and libtorch share one C++ standard library (cmake/standard_library.cmake).
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <exception>
#include <filesystem>
#include <string>

namespace graupel::train {
namespace {

/// The file that `address` was loaded from.
std::string file_of(const void* address) {
  Dl_info info{};
  if (dladdr(address, &info) == 0 || info.dli_fname == nullptr) return "";
  return std::filesystem::path(info.dli_fname).filename().string();
}

TEST(StandardLibrary, IsTheSharedOneThatLibtorchLoads) {
#ifndef __GLIBCXX__
  GTEST_SKIP() << "not libstdc++";
#endif
  // A static copy has its own std::call_once state, so FBGEMM's code cache inside libtorch calls a null pointer.
  EXPECT_EQ(file_of(reinterpret_cast<const void*>(&std::get_terminate)), "libstdc++.so.6");
}

}  // namespace
}  // namespace graupel::train
