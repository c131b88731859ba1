#include "io/trajectory/state_file.h"

#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "io/config/json_node.h"

namespace graupel::io {

namespace {

constexpr std::string_view kind = "graupel-state ", first_line = "graupel-state 1\n";
constexpr std::size_t most_header_bytes = std::size_t(1) << 20;

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw InputError("'" + path + "' cannot be used as a saved state (" + why +
                   "). Choose another state file, or start the run again from its scene");
}

template <typename T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// Calls visit(array, length) for every array of a frame that the run stores.
template <typename Frame, typename Visitor>
void for_arrays(Frame& frame, const SavedRun& run, Visitor&& visit) {
  const auto n = static_cast<std::size_t>(run.particles);
  visit(frame.position, n);
  if (run.velocity) visit(frame.velocity, n);
  if (run.active) visit(frame.active, n);
  for (const ParticleField field : all_particle_fields)
    if (run.fields.contains(field)) visit(frame.fields[field], n * static_cast<std::size_t>(info_of(field).components));
}

uint64_t recent_frame_bytes(const SavedRun& run) {
  return sizeof(double) + static_cast<uint64_t>(run.particles) *
                              static_cast<uint64_t>(sizeof(Vec3f) * (run.velocity ? 2 : 1) + (run.active ? 1 : 0) +
                                                    sizeof(float) * run.fields.components());
}

std::string header_text(const SavedRun& run) {
  JsonNode header = JsonNode::object();
  header.set("version", JsonNode::of(run.version));
  header.set("device", JsonNode::of(run.device));
  header.set("precision", JsonNode::of(run.precision));
  header.set("seed", JsonNode::of(run.seed));
  header.set("frame", JsonNode::of(run.frame));
  header.set("time", JsonNode::of(run.time));
  header.set("particles", JsonNode::of(run.particles));
  header.set("output", JsonNode::of(run.output));
  header.set("velocity", JsonNode::of(run.velocity));
  header.set("active", JsonNode::of(run.active));
  header.set("fields", JsonNode::of(run.fields.names()));
  header.set("scene_bytes", JsonNode::of(static_cast<uint64_t>(run.scene_json.size())));
  if (run.forces) header.set("forces", JsonNode::of(true));
  header.set("recent_frames", JsonNode::of(static_cast<uint64_t>(run.recent.size())));
  header.set("state_bytes", JsonNode::of(static_cast<uint64_t>(run.state.size())));
  return write_json(header, JsonLayout::compact);
}

/// Values of the header; anything unexpected means that the file is damaged.
class Header {
 public:
  Header(const std::string& text, const std::string& path) : path_(path) {
    try {
      root_ = parse_json(text, path);
    } catch (const Error& error) {
      refuse(path, std::string("its header is damaged: ") + error.what());
    }
  }
  std::string text(const char* key) const { return get(key, JsonNode::Kind::string).text; }
  bool boolean(const char* key) const { return get(key, JsonNode::Kind::boolean).boolean; }
  bool has(const char* key) const { return root_.find(key) != nullptr; }
  uint64_t natural(const char* key) const {
    const JsonNode& node = get(key, JsonNode::Kind::integer);
    if (node.negative && node.magnitude != 0) refuse(path_, std::string("its header has a negative '") + key + "'");
    return node.magnitude;
  }
  double number(const char* key) const {
    const JsonNode* node = root_.find(key);
    if (node == nullptr || !node->is_number()) refuse(path_, std::string("its header lacks '") + key + "'");
    return node->as_double();
  }

 private:
  const JsonNode& get(const char* key, JsonNode::Kind wanted) const {
    const JsonNode* node = root_.find(key);
    if (node == nullptr || node->kind != wanted) refuse(path_, std::string("its header lacks '") + key + "'");
    return *node;
  }
  std::string path_;
  JsonNode root_;
};

/// Reads a file from its beginning to its end, keeping the checksum of what was read.
class Source {
 public:
  explicit Source(const std::string& path) : path_(path), stream_(path, std::ios::binary) {
    std::error_code code;
    if (std::filesystem::is_directory(path, code)) refuse(path, "it is a folder");
    if (!stream_) refuse(path, std::strerror(errno));
    size_ = std::filesystem::file_size(path, code);
    if (code) refuse(path, code.message());
  }
  uint64_t size() const { return size_; }
  uint64_t checksum() const { return checksum_; }
  void read(void* to, std::size_t n) {
    stream_.read(static_cast<char*>(to), static_cast<std::streamsize>(n));
    if (!stream_) refuse(path_, "it is cut short: " + std::to_string(size_) + " bytes");
    checksum_ = fnv1a(checksum_, to, n);
  }

 private:
  std::string path_;
  std::ifstream stream_;
  uint64_t size_ = 0, checksum_ = fnv_start;
};

std::string read_header(Source& source, const std::string& path) {
  std::string line(first_line.size(), '\0');
  uint64_t length = 0;
  if (source.size() < line.size()) refuse(path, "it is no state of a run");
  source.read(line.data(), line.size());
  if (line.substr(0, kind.size()) != kind) refuse(path, "it is no state of a run");
  if (line != first_line)
    refuse(path, "its format is '" + line.substr(0, line.find('\n')) + "', this program reads 'graupel-state 1'");
  source.read(&length, sizeof(length));
  if (length > most_header_bytes || length > source.size()) refuse(path, "its header is damaged");
  std::string text(length, '\0');
  source.read(text.data(), text.size());
  return text;
}

/// Lengths that the file's size does not bear out must not reserve memory.
void check_size(const std::string& path, const SavedRun& run, uint64_t size, uint64_t header_bytes,
                uint64_t scene_bytes, uint64_t recent, uint64_t state_bytes) {
  const uint64_t most = uint64_t(1) << 48;
  if (run.particles < 0 || uint64_t(run.particles) > (uint64_t(1) << 31) || scene_bytes > most || recent > 64 ||
      state_bytes > most)
    refuse(path, "its header is damaged");
  const uint64_t expected = first_line.size() + sizeof(uint64_t) + header_bytes + scene_bytes +
                            recent * recent_frame_bytes(run) + state_bytes + sizeof(uint64_t);
  if (size != expected)
    refuse(path, std::string(size < expected ? "it is cut short" : "it is too long") + ": " + std::to_string(size) +
                     " bytes, " + std::to_string(expected) + " expected");
}

}  // namespace

void write_state_file(const std::string& path, const SavedRun& run) {
  const std::string header = header_text(run);
  const uint64_t length = header.size();
  std::vector<std::string_view> pieces = {
      first_line, {reinterpret_cast<const char*>(&length), sizeof(length)}, header, run.scene_json};
  for (const ParticleFrame& frame : run.recent) {
    pieces.emplace_back(reinterpret_cast<const char*>(&frame.time), sizeof(frame.time));
    for_arrays(frame, run, [&](const auto& array, std::size_t size) {
      GRAUPEL_ASSERT(array.size() == size);
      pieces.push_back(bytes_of(array));
    });
  }
  pieces.push_back(bytes_of(run.state));
  uint64_t checksum = fnv_start;
  for (const std::string_view piece : pieces) checksum = fnv1a(checksum, piece.data(), piece.size());
  pieces.emplace_back(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
  write_file_atomically(path, pieces);
}

SavedRun read_state_file(const std::string& path) {
  Source source(path);
  const std::string text = read_header(source, path);
  const Header header(text, path);
  SavedRun run;
  run.version = header.text("version");
  run.device = header.text("device");
  run.precision = header.text("precision");
  run.seed = header.natural("seed");
  run.frame = static_cast<int64_t>(header.natural("frame"));
  run.time = header.number("time");
  run.particles = static_cast<int64_t>(header.natural("particles"));
  run.output = header.text("output");
  run.velocity = header.boolean("velocity");
  run.active = header.boolean("active");
  run.forces = header.has("forces") && header.boolean("forces");
  try {
    run.fields = FieldSet::parse(header.text("fields"));
  } catch (const ConfigError& error) {
    refuse(path, error.what());
  }
  const uint64_t scene = header.natural("scene_bytes"), recent = header.natural("recent_frames"),
                 state = header.natural("state_bytes");
  check_size(path, run, source.size(), text.size(), scene, recent, state);
  run.scene_json.resize(scene);
  source.read(run.scene_json.data(), scene);
  run.recent.resize(recent);
  for (ParticleFrame& frame : run.recent) {
    source.read(&frame.time, sizeof(frame.time));
    for_arrays(frame, run, [&](auto& array, std::size_t size) {
      array.resize(size);
      source.read(array.data(), size * sizeof(array[0]));
    });
  }
  run.state.resize(state);
  source.read(run.state.data(), state);
  const uint64_t computed = source.checksum();
  uint64_t stored = 0;
  source.read(&stored, sizeof(stored));
  if (stored != computed) refuse(path, "it is damaged: its checksum does not match");
  return run;
}

bool is_state_file(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string start(kind.size(), '\0');
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  return stream && start == kind;
}

}  // namespace graupel::io
