// Requests are taken by the letter; what is odd is refused.
#include "experiments/viewer/http_message.h"

#include <gtest/gtest.h>

namespace graupel::experiments {
namespace {

int status_of(const std::string& head) {
  try {
    parse_http_request(head);
  } catch (const HttpError& error) {
    return error.status;
  }
  return 200;
}

TEST(HttpMessage, ReadsARequest) {
  const HttpRequest request =
      parse_http_request("GET /a/b?c=../d HTTP/1.1\r\nHost: 127.0.0.1:8\r\nRANGE:  bytes=0-1 \r\n\r\n");
  EXPECT_EQ(request.method, "GET");
  EXPECT_EQ(request.path, "/a/b");
  EXPECT_EQ(request.field("host"), "127.0.0.1:8");
  EXPECT_EQ(request.field("range"), "bytes=0-1");
  EXPECT_EQ(request.field("origin"), "");
  EXPECT_TRUE(request.keep_alive);
  EXPECT_FALSE(parse_http_request("GET / HTTP/1.1\r\nConnection: Close\r\n\r\n").keep_alive);
  EXPECT_FALSE(parse_http_request("GET / HTTP/1.0\r\n\r\n").keep_alive);
}

TEST(HttpMessage, RefusesWhatIsOdd) {
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\n\r\n"), 200);
  EXPECT_EQ(status_of("GET / HTTP/2\r\n\r\n"), 505);
  EXPECT_EQ(status_of("GET /\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET http://a/ HTTP/1.1\r\n\r\n"), 400);
  EXPECT_EQ(status_of("G(T / HTTP/1.1\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET /\x01 HTTP/1.1\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\nHost: a\r\nhost: b\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\nHost : a\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\n folded\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\na: b\nc: d\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\nHost: a\r\n"), 400);
  EXPECT_EQ(status_of("POST / HTTP/1.1\r\nContent-Length: 0\r\n\r\n"), 200);
  EXPECT_EQ(status_of("POST / HTTP/1.1\r\nContent-Length: 1\r\n\r\n"), 413);
  EXPECT_EQ(status_of("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n"), 413);
}

TEST(HttpMessage, RangesOfBytes) {
  const auto range = [](const std::string& field, uint64_t size) {
    const auto found = parse_byte_range(field, size);
    return std::pair(found->first, found->count);
  };
  EXPECT_FALSE(parse_byte_range("", 10));
  EXPECT_EQ(range("bytes=0-9", 10), std::pair(uint64_t(0), uint64_t(10)));
  EXPECT_EQ(range("bytes=3-3", 10), std::pair(uint64_t(3), uint64_t(1)));
  EXPECT_EQ(range("bytes=3-99", 10), std::pair(uint64_t(3), uint64_t(7)));
  EXPECT_EQ(range("bytes=3-", 10), std::pair(uint64_t(3), uint64_t(7)));
  EXPECT_EQ(range("bytes=-4", 10), std::pair(uint64_t(6), uint64_t(4)));
  EXPECT_EQ(range("bytes=-40", 10), std::pair(uint64_t(0), uint64_t(10)));
  for (const char* bad : {"bytes=10-11", "bytes=4-3", "bytes=-0", "bytes=-", "bytes=a-b", "bytes=0-1,3-4", "bits=0-1",
                          "bytes=99999999999999999999-", "bytes=1"})
    EXPECT_THROW(parse_byte_range(bad, 10), HttpError) << bad;
  EXPECT_THROW(parse_byte_range("bytes=0-0", 0), HttpError);
}

}  // namespace
}  // namespace graupel::experiments
