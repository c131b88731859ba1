// TensorBoard event files: TFRecords of hand-encoded protobuf messages.
// Record: u64 length, masked crc32c(length), bytes, masked crc32c(bytes), all little-endian. Message Event: 1 wall_time
// (double), 2 step (int64), 3 file_version (string), 5 summary { 1 value { 1 tag (string), 2 simple_value (float) } }.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

namespace graupel::train {

/// TFRecord's masked checksum: rotated right by 15 bits, plus 0xa282ead8.
uint32_t masked_crc32c(std::string_view bytes);
/// One framed record.
std::string tf_record(std::string_view bytes);
/// Event with one scalar.
std::string scalar_event(double wall_time, int64_t step, std::string_view tag, float value);

class EventFile {
 public:
  /// Creates events.out.tfevents.<seconds>.graupel in a folder. Throws IoError.
  EventFile(const std::string& folder, double wall_time);
  void scalar(double wall_time, int64_t step, std::string_view tag, double value);
  void flush();

 private:
  void write(const std::string& event);
  std::string path_;
  std::ofstream stream_;
};

}  // namespace graupel::train
