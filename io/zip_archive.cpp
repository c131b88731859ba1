#include "io/zip_archive.h"

#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <cstring>
#include <exception>

#include "core/error.h"

namespace graupel::io {

namespace {

constexpr uint64_t largest_ratio = 1100;  // deflate unfolds at most 1032 times
constexpr std::size_t piece = std::size_t(64) << 20;
constexpr int deflate_level = 1;          // positions hardly shrink; NumPy reads what is written fast
constexpr zip_uint16_t first_day = 0x21;  // 1980-01-01: no times in the file

uint64_t memory_bytes() {
  return static_cast<uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(::sysconf(_SC_PAGE_SIZE));
}

std::string text_of(zip_error_t* error) {
  std::string text = zip_error_strerror(error);
  zip_error_fini(error);
  return text;
}

std::string open_error(int code) {
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  return text_of(&error);
}

}  // namespace

struct ZipReader::Impl {
  std::string path;
  zip_t* archive = nullptr;
  std::vector<std::string> names;

  ~Impl() {
    if (archive) zip_discard(archive);
  }
  [[noreturn]] void fail(std::size_t member, const std::string& what) const {
    throw InputError("cannot read '" + names[member] + "' in '" + path + "' (" + what +
                     "). The archive is damaged or of another kind; make it again");
  }
};

ZipReader::ZipReader(const std::string& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  int code = 0;
  impl_->archive = zip_open(path.c_str(), ZIP_RDONLY, &code);
  if (!impl_->archive)
    throw InputError("cannot read '" + path + "' (" + open_error(code) + "). Give a whole .npz archive");
  const zip_int64_t count = zip_get_num_entries(impl_->archive, 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const char* name = zip_get_name(impl_->archive, static_cast<zip_uint64_t>(i), ZIP_FL_ENC_GUESS);
    if (!name) throw InputError("cannot read '" + path + "' (a member has no name). Make the archive again");
    impl_->names.emplace_back(name);
  }
  if (count == 0) throw InputError("cannot read '" + path + "' (it has no members). Make the archive again");
}

ZipReader::~ZipReader() = default;
ZipReader::ZipReader(ZipReader&&) noexcept = default;
const std::vector<std::string>& ZipReader::names() const { return impl_->names; }

std::string ZipReader::read(std::size_t member) const {
  zip_stat_t facts;
  if (zip_stat_index(impl_->archive, member, 0, &facts) != 0) impl_->fail(member, zip_strerror(impl_->archive));
  if ((facts.valid & ZIP_STAT_SIZE) == 0 || (facts.valid & ZIP_STAT_COMP_SIZE) == 0)
    impl_->fail(member, "its size is not known");
  if (facts.size / largest_ratio > facts.comp_size) impl_->fail(member, "it claims more bytes than it can unfold to");
  if (facts.size > memory_bytes())
    impl_->fail(member, "it unfolds to " + std::to_string(facts.size) + " bytes, more than this machine's memory");
  std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file(zip_fopen_index(impl_->archive, member, 0), zip_fclose);
  if (!file) impl_->fail(member, zip_strerror(impl_->archive));
  std::string bytes;
  std::size_t have = 0;
  while (have < facts.size) {
    if (have == bytes.size())
      bytes.resize(have + std::min<std::size_t>(piece, facts.size - have));  // as far as it is true
    const zip_int64_t got = zip_fread(file.get(), bytes.data() + have, bytes.size() - have);
    if (got < 0) impl_->fail(member, zip_file_strerror(file.get()));
    if (got == 0) impl_->fail(member, "it is cut short");
    have += static_cast<std::size_t>(got);
  }
  char beyond = 0;  // the checksum is compared at the end
  const zip_int64_t more = zip_fread(file.get(), &beyond, 1);
  if (more < 0) impl_->fail(member, zip_file_strerror(file.get()));
  if (more > 0) impl_->fail(member, "it has more bytes than it claims");
  return bytes;
}

namespace {

/// A member that is made when the library opens it, and let go when it was read.
struct PendingMember {
  const std::function<std::string(std::size_t)>* bytes_of;
  std::size_t number;
  std::exception_ptr* failure;
  std::string bytes = {};
  std::size_t given = 0;

  zip_int64_t open() {
    try {
      bytes = (*bytes_of)(number);
      given = 0;
      return 0;
    } catch (...) {
      *failure = std::current_exception();
      return -1;
    }
  }
  zip_int64_t read(void* to, zip_uint64_t most) {
    const std::size_t count = std::min<std::size_t>(most, bytes.size() - given);
    std::memcpy(to, bytes.data() + given, count);
    given += count;
    return static_cast<zip_int64_t>(count);
  }
  zip_int64_t facts(void* out) const {
    auto* stat = static_cast<zip_stat_t*>(out);
    zip_stat_init(stat);
    return sizeof(*stat);
  }
};

zip_int64_t answer(void* member, void* data, zip_uint64_t length, zip_source_cmd_t command) {
  auto& pending = *static_cast<PendingMember*>(member);
  switch (command) {
    case ZIP_SOURCE_OPEN:
      return pending.open();
    case ZIP_SOURCE_READ:
      return pending.read(data, length);
    case ZIP_SOURCE_CLOSE:
      std::string().swap(pending.bytes);
      return 0;
    case ZIP_SOURCE_STAT:
      return pending.facts(data);
    case ZIP_SOURCE_ERROR: {
      const int codes[2] = {ZIP_ER_INTERNAL, 0};
      std::memcpy(data, codes, sizeof(codes));
      return sizeof(codes);
    }
    case ZIP_SOURCE_FREE:
      return 0;
    case ZIP_SOURCE_SUPPORTS:
      return zip_source_make_command_bitmap(ZIP_SOURCE_OPEN, ZIP_SOURCE_READ, ZIP_SOURCE_CLOSE, ZIP_SOURCE_STAT,
                                            ZIP_SOURCE_ERROR, ZIP_SOURCE_FREE, -1);
    default:
      return -1;
  }
}

[[noreturn]] void fail_writing(const std::string& path, const std::string& what) {
  throw IoError("cannot write '" + path + "' (" + what + "). Free space on that disk or choose another folder");
}

}  // namespace

void write_zip(const std::string& path, const std::vector<std::string>& names,
               const std::function<std::string(std::size_t)>& bytes_of) {
  std::exception_ptr failure;
  std::vector<PendingMember> members;
  for (std::size_t i = 0; i < names.size(); ++i) members.push_back({&bytes_of, i, &failure});
  int code = 0;
  std::unique_ptr<zip_t, void (*)(zip_t*)> archive(zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code),
                                                   zip_discard);
  if (!archive) fail_writing(path, open_error(code));
  for (std::size_t i = 0; i < names.size(); ++i) {
    zip_source_t* source = zip_source_function(archive.get(), answer, &members[i]);
    if (!source) fail_writing(path, zip_strerror(archive.get()));
    const zip_int64_t index = zip_file_add(archive.get(), names[i].c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      fail_writing(path, zip_strerror(archive.get()));
    }
    const auto entry = static_cast<zip_uint64_t>(index);
    if (zip_set_file_compression(archive.get(), entry, ZIP_CM_DEFLATE, deflate_level) != 0 ||
        zip_file_set_dostime(archive.get(), entry, 0, first_day, 0) != 0)
      fail_writing(path, zip_strerror(archive.get()));
  }
  if (zip_close(archive.get()) != 0) {
    if (failure) std::rethrow_exception(failure);
    fail_writing(path, zip_strerror(archive.get()));
  }
  static_cast<void>(archive.release());  // zip_close has freed it
}

}  // namespace graupel::io
