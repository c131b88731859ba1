// HTTP/1.1 as far as the viewer's page needs it (RFC 9110, 9112): heads of requests without a body, one range of bytes,
// heads of responses. No sockets here.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace graupel::experiments {

/// What is answered instead of the thing asked for.
struct HttpError : std::runtime_error {
  HttpError(int code, const std::string& text, std::string more_fields = "")
      : std::runtime_error(text), status(code), fields(std::move(more_fields)) {}
  int status;
  std::string fields;  ///< lines of the answer's head: "Allow: GET, POST\r\n"
};

struct HttpRequest {
  std::string method;                         ///< GET, POST, ...
  std::string path;                           ///< as sent, without the query: "/a/b"; nothing of it is decoded
  std::map<std::string, std::string> fields;  ///< names in lower case
  bool keep_alive = true;

  /// "" where the field is absent.
  const std::string& field(const std::string& name) const;
};

inline constexpr std::size_t most_head_bytes = 16 << 10;

/// Of a head with the blank line that ends it. Throws HttpError for what is no request, for a field that comes twice,
/// and for a request with a body: none is taken.
HttpRequest parse_http_request(std::string_view head);

struct ByteRange {
  uint64_t first = 0, count = 0;
};
/// Of a Range field; nothing for "". Throws HttpError 416 unless it is one range that begins inside `size` bytes.
std::optional<ByteRange> parse_byte_range(std::string_view field, uint64_t size);

/// Bytes that are made when they are sent; several threads may read at once.
class HttpContent {
 public:
  virtual ~HttpContent() = default;
  virtual uint64_t size() const = 0;
  /// Bytes [first, first + out.size()). May throw any Error.
  virtual void read(uint64_t first, std::span<std::byte> out) const = 0;
};

/// Status line and fields, `more_fields` among them, with the blank line; `range` of a content of `size` bytes makes it
/// 206.
std::string http_response_head(int status, const std::string& type, uint64_t size,
                               const std::optional<ByteRange>& range, bool keep_alive,
                               const std::string& more_fields = "");

}  // namespace graupel::experiments
