#include "experiments/viewer/viewer_routes.h"

#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>

#include "core/system/error.h"
#include "experiments/viewer/page_data.h"
#include "experiments/viewer/page_files.h"

namespace graupel::experiments {

namespace {

/// Takes as long whatever the two have in common.
bool equal_secrets(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  int difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) difference |= a[i] ^ b[i];
  return difference == 0;
}

/// All frames that a source has, one after another.
class FramesContent : public HttpContent {
 public:
  explicit FramesContent(std::shared_ptr<FrameSource> source)
      : source_(std::move(source)), record_(source_->facts().record_bytes()), frames_(source_->status().frames) {}

  uint64_t size() const override { return static_cast<uint64_t>(frames_) * record_; }

  void read(uint64_t first, std::span<std::byte> out) const override {
    while (!out.empty()) {
      const auto frame = static_cast<int64_t>(first / record_);
      const auto offset = static_cast<std::size_t>(first % record_);
      const std::size_t here = std::min(out.size(), record_ - offset);
      source_->read(frame, offset, out.first(here));
      out = out.subspan(here);
      first += here;
    }
  }

 private:
  std::shared_ptr<FrameSource> source_;
  std::size_t record_;
  int64_t frames_;
};

HttpResponse bytes_response(std::string bytes) {
  return {.type = "application/octet-stream", .text = std::move(bytes)};
}
HttpResponse json_response(std::string text) { return {.type = "application/json", .text = std::move(text)}; }

[[noreturn]] void not_found() { throw HttpError(404, "there is nothing at this address"); }

}  // namespace

std::string random_token() {
  unsigned char bytes[16];
  if (::getrandom(bytes, sizeof bytes, 0) != sizeof bytes)
    throw IoError("the system gives no random numbers (getrandom). Try again");
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

ViewerSide::ViewerSide(std::function<std::shared_ptr<FrameSource>(uint32_t)> begin)
    : begin_(std::move(begin)), source_(begin_(0)) {}

std::shared_ptr<FrameSource> ViewerSide::source() const {
  const std::lock_guard lock(mutex_);
  return source_;
}

void ViewerSide::restart() {
  static std::mutex one_at_a_time;
  const std::lock_guard alone(one_at_a_time);
  const std::shared_ptr<FrameSource> next = begin_(run_ + 1);
  ++run_;
  source()->stop();
  const std::lock_guard lock(mutex_);
  source_ = next;
}

/// A page elsewhere that knows the port, or whose name was pointed at this machine, gets nothing.
void ViewerRoutes::check_sender(const HttpRequest& request) const {
  const int port = port_;
  const std::string here[] = {fmt::format("127.0.0.1:{}", port), fmt::format("localhost:{}", port)};
  const auto is_ours = [&](const std::string& host) {
    return host == here[0] || host == here[1] || (port == 80 && (host == "127.0.0.1" || host == "localhost"));
  };
  if (!is_ours(request.field("host")))
    throw HttpError(403, fmt::format("the Host is not this program's (allowed: {} or {})", here[0], here[1]));
  const std::string& origin = request.field("origin");
  constexpr std::string_view scheme = "http://";
  if (!origin.empty() && !(origin.starts_with(scheme) && is_ours(origin.substr(scheme.size()))))
    throw HttpError(403, "another page asks; only the viewer's own page may");
}

HttpResponse ViewerRoutes::answer(const HttpRequest& request) const {
  check_sender(request);
  const std::string& path = request.path;
  const auto slash = path.find('/', 1);
  if (!equal_secrets(std::string_view(path).substr(1, slash == std::string::npos ? slash : slash - 1), token_))
    throw HttpError(403, "the address lacks its secret word. Open the one that graupel view printed");
  if (slash == std::string::npos) not_found();
  const std::string rest = path.substr(slash + 1);
  if (request.method == "GET") return get(rest);
  if (request.method == "POST") return post(rest);
  throw HttpError(405, "only GET and POST are answered", "Allow: GET, POST\r\n");
}

HttpResponse ViewerRoutes::get(const std::string& path) const {
  for (const PageFile& file : page_files())
    if (path == file.route) return {.type = file.type, .text = std::string(file.text)};
  Sources sources;
  for (const auto& side : sides_) sources.push_back(side->source());
  if (path == "facts.json") return json_response(facts_json(sources));
  if (path == "status.json") return json_response(status_json(sources));
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string side = std::to_string(i);
    if (path == side + "/frames")
      return {.type = "application/octet-stream", .text = {}, .content = std::make_shared<FramesContent>(sources[i])};
    if (path == side + "/types") return bytes_response(type_bytes(sources[i]->facts()));
    if (path == side + "/obstacles") return bytes_response(obstacle_bytes(sources[i]->facts()));
  }
  not_found();
}

HttpResponse ViewerRoutes::post(const std::string& path) const {
  for (std::size_t i = 0; i < sides_.size(); ++i) {
    const std::string side = std::to_string(i);
    const std::shared_ptr<FrameSource> source = sides_[i]->source();
    if (!source->facts().live) continue;
    if (path == side + "/play" || path == side + "/pause") {
      source->pause(path == side + "/pause");
      return json_response("{}");
    }
    if (path == side + "/restart") {
      sides_[i]->restart();
      return json_response("{}");
    }
  }
  not_found();
}

}  // namespace graupel::experiments
