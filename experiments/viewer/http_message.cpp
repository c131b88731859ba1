#include "experiments/viewer/http_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace graupel::experiments {

namespace {

/// Characters of methods and of names of fields (RFC 9110, 5.6.2).
bool is_token(std::string_view text) {
  constexpr std::string_view others = "!#$%&'*+-.^_`|~";
  return !text.empty() && std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
           others.find(c) != std::string_view::npos;
  });
}

bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) { return c >= 0x20 && c < 0x7f; });
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

/// The text before `end`, which is taken from `rest` together with it.
std::string_view take_until(std::string_view& rest, std::string_view end) {
  const auto at = rest.find(end);
  if (at == std::string_view::npos) throw HttpError(400, "the request is cut short");
  const std::string_view taken = rest.substr(0, at);
  rest.remove_prefix(at + end.size());
  return taken;
}

void parse_request_line(std::string_view line, HttpRequest& request) {
  request.method = take_until(line, " ");
  const std::string_view target = take_until(line, " ");
  if (!is_token(request.method) || target.empty() || target[0] != '/' || !is_printable(target))
    throw HttpError(400, "the request line is not of HTTP");
  if (line != "HTTP/1.1" && line != "HTTP/1.0") throw HttpError(505, "only HTTP/1.1 is spoken");
  request.path = target.substr(0, target.find('?'));
  request.keep_alive = line == "HTTP/1.1";
}

std::optional<uint64_t> whole_number_of(std::string_view text) {
  uint64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

const char* reason_of(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 206:
      return "Partial Content";
    case 400:
      return "Bad Request";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 413:
      return "Content Too Large";
    case 416:
      return "Range Not Satisfiable";
    case 431:
      return "Request Header Fields Too Large";
    case 503:
      return "Service Unavailable";
    case 505:
      return "HTTP Version Not Supported";
    default:
      return "Internal Server Error";
  }
}

}  // namespace

const std::string& HttpRequest::field(const std::string& name) const {
  static const std::string absent;
  const auto found = fields.find(name);
  return found == fields.end() ? absent : found->second;
}

HttpRequest parse_http_request(std::string_view head) {
  HttpRequest request;
  parse_request_line(take_until(head, "\r\n"), request);
  for (std::string_view line; !(line = take_until(head, "\r\n")).empty();) {
    const auto colon = line.find(':');
    const std::string_view name = line.substr(0, std::min(colon, line.size()));
    if (colon == std::string_view::npos || !is_token(name)) throw HttpError(400, "a header field is not of HTTP");
    const std::string_view value = trimmed(line.substr(colon + 1));
    if (value.find_first_of(std::string_view("\r\n\0", 3)) != std::string_view::npos)
      throw HttpError(400, "a header field holds control characters");
    const bool is_new = request.fields.emplace(lower_case(name), value).second;
    if (!is_new) throw HttpError(400, "a header field comes twice");
  }
  const std::string& length = request.field("content-length");
  if (!request.field("transfer-encoding").empty() || (!length.empty() && length != "0"))
    throw HttpError(413, "a request with a body is not taken");
  const std::string connection = lower_case(request.field("connection"));
  if (connection == "close") request.keep_alive = false;
  return request;
}

std::optional<ByteRange> parse_byte_range(std::string_view field, uint64_t size) {
  if (field.empty()) return std::nullopt;
  const auto refuse = [&]() -> ByteRange {
    throw HttpError(416, fmt::format("the range is not one of {} bytes (allowed: bytes=FIRST-LAST)", size),
                    fmt::format("Content-Range: bytes */{}\r\n", size));
  };
  constexpr std::string_view unit = "bytes=";
  if (field.substr(0, unit.size()) != unit) return refuse();
  field.remove_prefix(unit.size());
  const auto dash = field.find('-');
  if (dash == std::string_view::npos) return refuse();
  const auto first = whole_number_of(field.substr(0, dash)), last = whole_number_of(field.substr(dash + 1));
  if (dash == 0) {  // the last bytes
    if (!last || *last == 0 || size == 0) return refuse();
    const uint64_t count = std::min(*last, size);
    return ByteRange{size - count, count};
  }
  if (!first || *first >= size) return refuse();
  if (dash + 1 == field.size()) return ByteRange{*first, size - *first};
  if (!last || *last < *first) return refuse();
  return ByteRange{*first, std::min(*last, size - 1) - *first + 1};
}

std::string http_response_head(int status, const std::string& type, uint64_t size,
                               const std::optional<ByteRange>& range, bool keep_alive, const std::string& more_fields) {
  std::string head = fmt::format("HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\n", status,
                                 reason_of(status), type, range ? range->count : size);
  if (range)
    head += fmt::format("Content-Range: bytes {}-{}/{}\r\n", range->first, range->first + range->count - 1, size);
  head += more_fields;
  // Nothing from elsewhere runs in the page or frames it, and its address, which holds the token, is told to nobody.
  head +=
      "Cache-Control: no-store\r\nAccept-Ranges: bytes\r\nX-Content-Type-Options: nosniff\r\n"
      "Referrer-Policy: no-referrer\r\nX-Frame-Options: DENY\r\nCross-Origin-Resource-Policy: same-origin\r\n"
      "Content-Security-Policy: default-src 'self'; img-src 'self' data: blob:; frame-ancestors 'none'; "
      "base-uri 'none'; form-action 'none'\r\n";
  head += keep_alive ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
  return head;
}

}  // namespace graupel::experiments
