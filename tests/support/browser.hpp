/// A browser that tests steer: headless Chromium, by its DevTools protocol.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "support/folder.hpp"
#include "view/beast.hpp"

namespace phyxel::test {

/// A page in a browser that lives as long as the object.
class Browser {
 public:
  using Json = nlohmann::json;

  /// @param folder for its files
  Browser(const std::filesystem::path& folder, const std::string& address) {
    const std::filesystem::path log = folder / "chromium.txt";
    const std::vector<std::string> words = {"chromium",
                                            "--headless=new",
                                            "--no-sandbox",
                                            "--use-angle=swiftshader",
                                            "--enable-unsafe-swiftshader",
                                            "--window-size=1000,900",
                                            "--remote-debugging-port=0",
                                            "--user-data-dir=" + (folder / "chromium").string(),
                                            address};
    child_ = fork();
    if (child_ == 0) {
      setpgid(0, 0);
      if (!freopen("/dev/null", "w", stdout) || !freopen(log.c_str(), "w", stderr)) _exit(99);
      std::vector<char*> argv;
      for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
      argv.push_back(nullptr);
      execvp(argv[0], argv.data());
      _exit(99);
    }
    connect(log, address);
  }
  ~Browser() {
    kill(-child_, SIGKILL);
    waitpid(child_, nullptr, 0);
  }
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  /// The value of an expression of the page's script.
  Json value(const std::string& expression) {
    return call("Runtime.evaluate",
                {{"expression", expression}, {"returnByValue", true}})["result"]["value"];
  }
  /// Waits until an expression of the page is true, at most two minutes.
  bool comes_true(const std::string& expression) {
    for (int k = 0; k < 2400; ++k) {
      if (value(expression) == true) return true;
      usleep(50'000);
    }
    return false;
  }
  /// An event of the mouse: "mousePressed", "mouseMoved" or "mouseReleased", at a place of the
  /// window [px].
  void mouse(const std::string& type, double x, double y) {
    call("Input.dispatchMouseEvent", {{"type", type},
                                      {"x", x},
                                      {"y", y},
                                      {"button", "left"},
                                      {"buttons", 1},
                                      {"clickCount", 1}});
  }

 private:
  using tcp = boost::asio::ip::tcp;

  void connect(const std::filesystem::path& log, const std::string& address) {
    std::string port;
    for (int k = 0; k < 1200 && port.empty(); ++k) {
      const std::string text = text_of(log), mark = "DevTools listening on ws://127.0.0.1:";
      const std::size_t at = text.find(mark), end = text.find('/', at + mark.size());
      if (at != std::string::npos && end != std::string::npos) {
        port = text.substr(at + mark.size(), end - at - mark.size());
      } else {
        usleep(50'000);
      }
    }
    ASSERT_FALSE(port.empty()) << text_of(log);
    const std::string path = page_path(port, address.substr(0, address.find('#')));
    ASSERT_FALSE(path.empty());
    tcp::socket socket(context_);
    socket.connect(
        {boost::asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(std::stoi(port))});
    stream_ = std::make_unique<Stream>(std::move(socket));
    stream_->read_message_max(0);
    stream_->handshake("127.0.0.1:" + port, path);
  }
  /// The path at which the page's messages are exchanged.
  std::string page_path(const std::string& port, const std::string& address) {
    namespace http = boost::beast::http;
    for (int k = 0; k < 600; ++k) {
      tcp::socket socket(context_);
      socket.connect({boost::asio::ip::make_address("127.0.0.1"),
                      static_cast<unsigned short>(std::stoi(port))});
      http::request<http::empty_body> request(http::verb::get, "/json/list", 11);
      request.set(http::field::host, "127.0.0.1:" + port);
      http::write(socket, request);
      boost::beast::flat_buffer buffer;
      http::response<http::string_body> response;
      http::read(socket, buffer, response);
      for (const Json& target : Json::parse(response.body())) {
        if (target.value("type", "") != "page") continue;
        if (target.value("url", "").rfind(address, 0) != 0) continue;
        const std::string url = target["webSocketDebuggerUrl"];
        return url.substr(url.find('/', 5));
      }
      usleep(50'000);
    }
    return {};
  }
  Json call(const std::string& method, const Json& parameters) {
    if (!stream_) return {};
    const int id = ++calls_;
    stream_->write(
        boost::asio::buffer(Json{{"id", id}, {"method", method}, {"params", parameters}}.dump()));
    while (true) {
      boost::beast::flat_buffer buffer;
      stream_->read(buffer);
      const Json answer = Json::parse(boost::beast::buffers_to_string(buffer.data()));
      if (answer.value("id", 0) != id) continue;  // an event
      EXPECT_FALSE(answer.contains("error")) << answer.dump();
      return answer.value("result", Json::object());
    }
  }

  using Stream = boost::beast::websocket::stream<tcp::socket>;
  pid_t child_ = -1;
  boost::asio::io_context context_;
  std::unique_ptr<Stream> stream_;
  int calls_ = 0;
};

}  // namespace phyxel::test
