#include "train/loop/event_file.h"

#include <bit>
#include <cstring>

#include "core/system/error.h"
#include "train/loop/crc32c.h"

namespace graupel::train {

static_assert(std::endian::native == std::endian::little, "event files are written as memory lies");

namespace {

template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}
std::string varint(uint64_t value) {
  std::string bytes;
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<char>(value | 0x80));
  bytes.push_back(static_cast<char>(value));
  return bytes;
}
/// Protobuf key of a field; wire types: 0 varint, 1 64 bits, 2 length-delimited, 5 32 bits.
std::string key(int field, int wire_type) { return varint(static_cast<uint64_t>(field * 8 + wire_type)); }
std::string text_field(int field, std::string_view text) {
  return key(field, 2) + varint(text.size()) + std::string(text);
}

}  // namespace

uint32_t masked_crc32c(std::string_view bytes) { return std::rotr(crc32c(bytes), 15) + 0xa282ead8u; }

std::string tf_record(std::string_view bytes) {
  const std::string length = raw(static_cast<uint64_t>(bytes.size()));
  return length + raw(masked_crc32c(length)) + std::string(bytes) + raw(masked_crc32c(bytes));
}

std::string scalar_event(double wall_time, int64_t step, std::string_view tag, float value) {
  const std::string entry = text_field(1, tag) + key(2, 5) + raw(value);
  return key(1, 1) + raw(wall_time) + key(2, 0) + varint(static_cast<uint64_t>(step)) +
         text_field(5, text_field(1, entry));
}

EventFile::EventFile(const std::string& folder, double wall_time)
    : path_(folder + "/events.out.tfevents." + std::to_string(static_cast<int64_t>(wall_time)) + ".graupel"),
      stream_(path_, std::ios::binary | std::ios::app) {
  write(key(1, 1) + raw(wall_time) + text_field(3, "brain.Event:2"));
  flush();
}

void EventFile::scalar(double wall_time, int64_t step, std::string_view tag, double value) {
  write(scalar_event(wall_time, step, tag, static_cast<float>(value)));
}

void EventFile::flush() {
  stream_.flush();
  if (!stream_) throw IoError("cannot write '" + path_ + "'. Free space on that disk or choose another folder");
}

void EventFile::write(const std::string& event) {
  const std::string record = tf_record(event);
  stream_.write(record.data(), static_cast<std::streamsize>(record.size()));
}

}  // namespace graupel::train
