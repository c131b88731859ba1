// A client of one connection, and the program under test as a child.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "tests/apps/program.h"

namespace graupel::test {

struct Answer {
  int status = 0;
  std::string head, body;
};

class Client {
 public:
  explicit Client(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)), port_(port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  bool connected() const { return connected_; }

  /// `fields` are lines with \r\n; Host is this server's unless they have one.
  Answer ask(const std::string& path, const std::string& fields = "", const std::string& method = "GET") {
    std::string text = method + " " + path + " HTTP/1.1\r\n" + fields;
    if (fields.find("Host:") == std::string::npos) text += "Host: 127.0.0.1:" + std::to_string(port_) + "\r\n";
    return send(text + "\r\n");
  }
  Answer send(const std::string& text) {
    ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    Answer answer;
    while (answer.head.find("\r\n\r\n") == std::string::npos)
      if (!receive(answer.head)) return answer;
    const auto end = answer.head.find("\r\n\r\n") + 4;
    answer.body = answer.head.substr(end);
    answer.head.resize(end);
    answer.status = std::atoi(answer.head.c_str() + 9);
    const auto length = answer.head.find("Content-Length: ");
    const auto size = static_cast<std::size_t>(std::atoll(answer.head.c_str() + length + 16));
    while (answer.body.size() < size)
      if (!receive(answer.body)) break;
    return answer;
  }

 private:
  bool receive(std::string& to) {
    char buffer[1 << 16];
    const ssize_t count = ::recv(socket_, buffer, sizeof buffer, 0);
    if (count > 0) to.append(buffer, static_cast<std::size_t>(count));
    return count > 0;
  }

  int socket_, port_;
  bool connected_ = false;
};

/// graupel view with these arguments (words), until stop().
class ViewProgram {
 public:
  explicit ViewProgram(const std::vector<std::string>& arguments) {
    int output[2];
    if (::pipe(output) != 0) return;
    child_ = ::fork();
    if (child_ == 0) {
      ::dup2(output[1], 1);
      ::close(output[0]);
      ::close(output[1]);
      std::vector<std::string> words = {GRAUPEL_BINARY_DIR "/graupel", "view"};
      words.insert(words.end(), arguments.begin(), arguments.end());
      std::vector<char*> argv;
      for (std::string& word : words) argv.push_back(word.data());
      argv.push_back(nullptr);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    ::close(output[1]);
    for (char c; ::read(output[0], &c, 1) == 1 && c != '\n';) address_ += c;
    ::close(output[0]);
  }
  ~ViewProgram() { stop(SIGKILL); }
  ViewProgram(const ViewProgram&) = delete;
  ViewProgram& operator=(const ViewProgram&) = delete;

  const std::string& address() const { return address_; }
  int port() const { return std::atoi(address_.c_str() + address_.rfind(':') + 1); }
  /// "/<token>/"
  std::string root() const { return address_.substr(address_.find('/', 8)); }
  /// Its exit code, 128 + the signal.
  int stop(int signal) {
    if (child_ <= 0) return -1;
    ::kill(child_, signal);
    int status = 0;
    ::waitpid(child_, &status, 0);
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t child_ = -1;
  std::string address_;
};

}  // namespace graupel::test
