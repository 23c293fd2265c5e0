/// The web server of a live view, by a client of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "phyxel/error.hpp"
#include "view/server.hpp"

#ifdef PHYXEL_HAVE_VIEW

#include "view/beast.hpp"

namespace phyxel::app {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;
using testing::HasSubstr;

class Server : public testing::Test {
 protected:
  std::string token() const {
    const std::string address = server_.address();
    return address.substr(address.find('=') + 1);
  }
  std::string port() const {
    const std::string address = server_.address();
    const std::size_t at = address.find(':', 6) + 1;
    return address.substr(at, address.find('/', at) - at);
  }
  tcp::socket connected() {
    tcp::socket socket(context_);
    socket.connect(
        {asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(std::stoi(port()))});
    return socket;
  }
  /// The answer to a request with some header fields.
  http::response<http::string_body> answer(const std::string& target, const std::string& host,
                                           const std::string& origin = {}) {
    tcp::socket socket = connected();
    http::request<http::empty_body> request(http::verb::get, target, 11);
    request.set(http::field::host, host);
    if (!origin.empty()) request.set(http::field::origin, origin);
    http::write(socket, request);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(socket, buffer, response);
    return response;
  }
  using Stream = beast::websocket::stream<tcp::socket>;
  /// A page that has joined, and its role.
  std::unique_ptr<Stream> joined(const std::string& role) {
    auto stream = std::make_unique<Stream>(connected());
    stream->handshake("127.0.0.1:" + port(), "/live?token=" + token());
    EXPECT_EQ(heard(*stream), "{\"role\": \"" + role + "\"}");
    return stream;
  }
  static std::string heard(Stream& stream) {
    beast::flat_buffer buffer;
    stream.read(buffer);
    return beast::buffers_to_string(buffer.data());
  }
  static void say(Stream& stream, const std::string& text) {
    stream.text(true);
    stream.write(asio::buffer(text));
  }
  /// Waits until a condition holds, at most ten seconds.
  template <class Condition>
  static bool comes_true(const Condition& condition) {
    for (int k = 0; k < 2000 && !condition(); ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return condition();
  }

  ViewServer server_{"127.0.0.1", 0, "<p>the page</p>"};
  asio::io_context context_;
};

TEST_F(Server, ServesItsPageToWhoKnowsTheToken) {
  const auto page = answer("/?token=" + token(), "127.0.0.1:" + port());
  EXPECT_EQ(page.result(), http::status::ok);
  EXPECT_EQ(page.body(), "<p>the page</p>");
  EXPECT_EQ(answer("/?token=" + token(), "localhost:" + port()).result(), http::status::ok);
  EXPECT_EQ(token().size(), 32u);
}

TEST_F(Server, RefusesOtherTokensNamesAndPages) {
  const std::string good = "/?token=" + token(), host = "127.0.0.1:" + port();
  std::string almost = good;
  almost.back() = almost.back() == '0' ? '1' : '0';
  for (const std::string& target : {std::string("/"), std::string("/?token="), almost}) {
    EXPECT_EQ(answer(target, host).result(), http::status::forbidden) << target;
  }
  // Another name that resolves to this machine, as by rebinding; and another page of the browser.
  EXPECT_EQ(answer(good, "evil.example:" + port()).result(), http::status::forbidden);
  EXPECT_EQ(answer(good, host, "http://evil.example").result(), http::status::forbidden);
  EXPECT_EQ(answer(good, host, "http://" + host).result(), http::status::ok);
  EXPECT_EQ(answer("/etc/passwd?token=" + token(), host).result(), http::status::not_found);
  Stream stream(connected());
  beast::error_code error;
  stream.handshake(host, "/live?token=0", error);
  EXPECT_TRUE(error);
}

TEST_F(Server, LetsOnePageSteerAndOthersWatch) {
  auto first = joined("steers"), second = joined("watches");
  say(*second, "not for me");
  say(*first, "hello");
  std::vector<std::string> messages;
  EXPECT_TRUE(comes_true([&] {
    for (const std::string& message : server_.take_messages()) messages.push_back(message);
    return !messages.empty();
  }));
  EXPECT_THAT(messages, testing::ElementsAre("hello"));
  server_.send_text("for all");
  EXPECT_EQ(heard(*first), "for all");
  EXPECT_EQ(heard(*second), "for all");
  // What the first one held is dropped when it leaves, and the second steers.
  first->close(beast::websocket::close_code::normal);
  EXPECT_EQ(heard(*second), "{\"role\": \"steers\"}");
  EXPECT_THAT(server_.take_messages(), testing::ElementsAre("{\"do\": \"drop\"}"));
  EXPECT_EQ(server_.watchers(), 1u);
  EXPECT_EQ(server_.joins(), 2u);
}

TEST_F(Server, KeepsTheLastPlaceOfAHandAndThatItLetsGo) {
  auto page = joined("steers");
  say(*page, R"({"do":"grab","phyxel":1})");
  for (int k = 0; k < 3000; ++k) {
    say(*page, R"({"do":"move","by":[)" + std::to_string(k) + ",0,0]}");
  }
  for (int k = 0; k < 1500; ++k) say(*page, R"({"do":"play"})");
  say(*page, R"({"do":"drop"})");
  page->close(beast::websocket::close_code::normal);  // what was said before is read before
  EXPECT_TRUE(comes_true([&] { return server_.watchers() == 0; }));
  const std::vector<std::string> messages = server_.take_messages();
  ASSERT_GT(messages.size(), 3u);
  EXPECT_LE(messages.size(), 1002u);
  EXPECT_EQ(messages[1], R"({"do":"move","by":[2999,0,0]})");
  EXPECT_EQ(messages[messages.size() - 2], R"({"do":"drop"})");
}

TEST_F(Server, SendsNoFrameToAPageThatHasNotDrawnTheLastTwo) {
  EXPECT_FALSE(server_.wants_frame());
  auto page = joined("steers");
  EXPECT_TRUE(comes_true([&] { return server_.wants_frame(); }));
  for (int k = 0; k < 5; ++k) {
    server_.send_frame(std::make_shared<const std::string>("frame " + std::to_string(k)));
  }
  server_.send_text("end");
  EXPECT_EQ(heard(*page), "frame 0");
  EXPECT_EQ(heard(*page), "frame 1");
  EXPECT_EQ(heard(*page), "end");
  EXPECT_FALSE(server_.wants_frame());
  say(*page, R"({"do":"seen"})");
  EXPECT_TRUE(comes_true([&] { return server_.wants_frame(); }));
  EXPECT_TRUE(server_.take_messages().empty());
}

TEST_F(Server, DropsAPageThatSendsTooMuchOrReadsNothing) {
  auto page = joined("steers");
  beast::error_code error;
  page->write(asio::buffer(std::string(1 << 20, 'x')), error);
  EXPECT_TRUE(comes_true([&] { return server_.watchers() == 0; }));
  auto idle = joined("steers");
  const std::string text(100'000, 'y');
  for (int k = 0; k < 2000; ++k) server_.send_text(text);
  EXPECT_TRUE(comes_true([&] { return server_.watchers() == 0; }));
}

TEST_F(Server, LivesThroughNonsense) {
  for (const std::string& nonsense :
       {std::string("\0\1\2\3", 4), std::string("GET"), std::string("GET / HTTP/1.1\r\n\r\n"),
        std::string(100'000, 'a'),
        std::string("POST / HTTP/1.1\r\nContent-Length: 99999999\r\n\r\n")}) {
    tcp::socket socket = connected();
    beast::error_code error;
    asio::write(socket, asio::buffer(nonsense), error);
  }
  EXPECT_EQ(answer("/?token=" + token(), "127.0.0.1:" + port()).result(), http::status::ok);
}

TEST(Servers, RefuseAddressesThatTheyCannotHave) {
  const auto refused = [](const std::string& host, int port) -> std::string {
    try {
      ViewServer(host, port, "");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refused("nowhere", 0), HasSubstr("nowhere"));
  EXPECT_THAT(refused("192.0.2.1", 0), HasSubstr("192.0.2.1"));
  const ViewServer first("127.0.0.1", 0, "");
  const std::string address = first.address();
  const std::size_t at = address.find(':', 6) + 1;
  EXPECT_THAT(refused("127.0.0.1", std::stoi(address.substr(at))), HasSubstr("--port"));
}

}  // namespace
}  // namespace phyxel::app

#else

TEST(Server, IsMissing) {
  EXPECT_FALSE(phyxel::app::has_view_server());
  EXPECT_THROW(phyxel::app::ViewServer("127.0.0.1", 0, ""), phyxel::InputError);
}

#endif
