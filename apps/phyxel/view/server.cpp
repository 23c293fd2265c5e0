#include "view/server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <random>
#include <string_view>
#include <thread>
#include <utility>

#include "phyxel/error.hpp"
#include "view/beast.hpp"

namespace phyxel::app {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using Text = std::shared_ptr<const std::string>;
using Request = http::request<http::empty_body>;

/// Limits on the traffic of clients.
constexpr std::size_t most_connections = 256, most_bytes_of_message = 4096,
                      most_unread_messages = 1000, most_queued_texts = 200;
constexpr unsigned most_header_bytes = 16384;
constexpr std::chrono::seconds patience{5};    // with a request
constexpr std::chrono::minutes slow_line{10};  // for the page
constexpr std::chrono::milliseconds farewell{100};
/// Frames under way to a page.
constexpr int most_frames_ahead = 2;

/// 128 random bits as hexadecimal digits.
std::string random_token() {
  std::random_device random;
  std::string token;
  for (int k = 0; k < 4; ++k) token += fmt::format("{:08x}", static_cast<std::uint32_t>(random()));
  return token;
}

/// Compares texts in a time that does not depend on where they differ.
bool equal_texts(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned different = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    different |= static_cast<unsigned char>(a[k]) ^ static_cast<unsigned char>(b[k]);
  }
  return different == 0;
}

std::string_view view_of(beast::string_view text) { return {text.data(), text.size()}; }

/// True for the message by which a page says that it has drawn a frame, {"do": "seen"}. Other
/// messages are requests to the scene.
bool is_seen(std::string_view text) { return text == R"({"do":"seen"})"; }

}  // namespace

/// The server's thread, its connections, and what both sides exchange. Members below the mutex are
/// shared with the caller's thread; all others belong to the server's.
class ViewServer::Impl {
 public:
  Impl(std::string host, std::string page) : host_(std::move(host)), page_(std::move(page)) {}

  void listen(int port) {
    beast::error_code error;
    const auto fail = [&](const char* what) {
      throw InputError(fmt::format(
          "cannot {} {} port {}: {}; allowed: an address of this machine (--host) and a free port "
          "(--port, 0: any)",
          what, host_, port, error.message()));
    };
    const asio::ip::address address = asio::ip::make_address(host_, error);
    if (error) fail("use the address");
    const tcp::endpoint endpoint(address, static_cast<unsigned short>(port));
    acceptor_.open(endpoint.protocol(), error);
    if (error) fail("open");
    acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    acceptor_.bind(endpoint, error);
    if (error) fail("listen at");
    acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error) fail("listen at");
    port_ = acceptor_.local_endpoint().port();
    local_ = address.is_loopback();
  }

  void start() {
    accept();
    thread_ = std::thread([this] { context_.run(); });
  }

  /// Ends the thread; texts on their way get a moment.
  void stop() {
    std::this_thread::sleep_for(farewell);
    context_.stop();
    thread_.join();
  }

  std::string address() const {
    const bool any = host_ == "0.0.0.0" || host_ == "::";
    const std::string name = any                                    ? std::string("<this machine>")
                             : host_.find(':') != std::string::npos ? "[" + host_ + "]"
                                                                    : host_;
    return fmt::format("http://{}:{}/?token={}", name, port_, token_);
  }

  class Page;

  /// A message to a page, which skips frames that it has no time for.
  struct Outgoing {
    Text text;
    bool frame = false;
  };

  // --- shared with the caller's thread -----------------------------------------------------------
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<std::string> messages_;
  std::atomic<std::size_t> watchers_{0};
  std::atomic<std::size_t> joins_{0};
  std::atomic<bool> wants_frame_{false};

  void send(Outgoing what) {
    asio::post(context_, [this, what = std::move(what)] { pass_on(what); });
  }

  static Text make_text(std::string text) {
    return std::make_shared<const std::string>(std::move(text));
  }

 private:
  class Visit;
  friend class Page;

  void accept() {
    acceptor_.async_accept([this](beast::error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (!error && visits_ + pages_.size() < most_connections) visit(std::move(socket));
      if (acceptor_.is_open()) accept();
    });
  }
  void visit(tcp::socket socket);
  void join(std::shared_ptr<Page> page);
  void leave(const std::shared_ptr<Page>& page);
  void pass_on(const Outgoing& what);
  void receive(Page& from, std::string text);
  void keep(std::string message);
  void count_wishes();

  /// True for a request that comes from the page of this server, or from outside any page.
  bool is_ours(const Request& request) const {
    const std::string_view host = view_of(request[http::field::host]);
    if (local_) {  // the port may be that of a tunnel
      const std::string_view name = host.substr(0, host.find_last_not_of("0123456789") + 1);
      bool known = false;
      for (const std::string& own :
           {std::string("127.0.0.1"), std::string("localhost"), std::string("[::1]"), host_}) {
        known = known || host == own || name == own + ":";
      }
      if (!known) return false;
    }
    const auto origin = request.find(http::field::origin);
    return origin == request.end() || view_of(origin->value()) == fmt::format("http://{}", host);
  }
  bool has_token(const Request& request) const {
    const std::string_view target = view_of(request.target());
    const std::size_t at = target.find("?token=");
    return at != std::string_view::npos && equal_texts(target.substr(at + 7), token_);
  }
  static std::string_view path_of(const Request& request) {
    const std::string_view target = view_of(request.target());
    return target.substr(0, target.find('?'));
  }

  std::string host_, page_, token_ = random_token();
  int port_ = 0;
  bool local_ = true;
  std::size_t visits_ = 0;  // before the context, whose end ends visits
  asio::io_context context_{1};
  tcp::acceptor acceptor_{context_};
  std::thread thread_;
  std::vector<std::shared_ptr<Page>> pages_;  // the first one steers
};

/// A connected page: reads its messages, and writes one message at a time.
class ViewServer::Impl::Page : public std::enable_shared_from_this<Page> {
 public:
  Page(Impl& server, websocket::stream<beast::tcp_stream> stream)
      : server_(server), stream_(std::move(stream)) {
    buffer_.max_size(most_bytes_of_message);
  }

  void begin(const Request& request) {
    stream_.read_message_max(most_bytes_of_message);
    stream_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    stream_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error) return self->end();
      self->server_.join(self);
      self->read();
    });
  }

  bool wants_frame() const { return !ended_ && sent_ - seen_ < most_frames_ahead; }

  void send(const Outgoing& what) {
    if (ended_) return;
    if (what.frame) {
      if (!wants_frame()) return;
      ++sent_;
    } else if (queue_.size() > most_queued_texts) {
      return end();
    }
    queue_.push_back(what);
    if (queue_.size() == 1) write();
  }

  void has_seen() {
    if (seen_ < sent_) ++seen_;
  }

 private:
  void read() {
    stream_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->end();
      self->server_.receive(*self, beast::buffers_to_string(self->buffer_.data()));
      self->buffer_.consume(self->buffer_.size());
      self->read();
    });
  }
  void write() {
    stream_.binary(queue_.front().frame);
    stream_.async_write(asio::buffer(*queue_.front().text),
                        [self = shared_from_this()](beast::error_code error, std::size_t) {
                          if (error) return self->end();
                          self->queue_.pop_front();
                          if (!self->queue_.empty()) self->write();
                        });
  }
  void end() {
    if (std::exchange(ended_, true)) return;
    beast::get_lowest_layer(stream_).cancel();
    server_.leave(shared_from_this());
  }

  Impl& server_;
  websocket::stream<beast::tcp_stream> stream_;
  beast::flat_buffer buffer_;
  std::deque<Outgoing> queue_;
  std::int64_t sent_ = 0, seen_ = 0;  // frames
  bool ended_ = false;
};

/// A connection whose request is still unknown.
class ViewServer::Impl::Visit : public std::enable_shared_from_this<Visit> {
 public:
  Visit(Impl& server, tcp::socket socket) : server_(server), stream_(std::move(socket)) {
    ++server_.visits_;
    parser_.header_limit(most_header_bytes);
  }
  ~Visit() { --server_.visits_; }

  void begin() {
    stream_.expires_after(patience);
    http::async_read(stream_, buffer_, parser_,
                     [self = shared_from_this()](beast::error_code error, std::size_t) {
                       if (!error) self->answer();
                     });
  }

 private:
  void answer() {
    const Request& request = parser_.get();
    if (!server_.is_ours(request)) {
      return send(http::status::forbidden, "This page is not served to other pages or names.\n");
    }
    if (!server_.has_token(request)) {
      return send(http::status::forbidden,
                  "The address lacks the token that phyxel view has printed.\n");
    }
    if (websocket::is_upgrade(request) && path_of(request) == "/live") {
      stream_.expires_never();
      std::make_shared<Page>(server_, websocket::stream<beast::tcp_stream>(std::move(stream_)))
          ->begin(request);
      return;
    }
    if (request.method() != http::verb::get || path_of(request) != "/") {
      return send(http::status::not_found, "There is one page only, \"/\".\n");
    }
    send(http::status::ok, server_.page_, "text/html; charset=utf-8");
  }
  void send(http::status status, std::string body, const char* type = "text/plain") {
    response_.result(status);
    response_.version(parser_.get().version());
    response_.set(http::field::content_type, type);
    response_.set(http::field::cache_control, "no-store");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Content-Security-Policy",
                  "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
                  "connect-src 'self'; img-src data: blob:; media-src blob:");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.keep_alive(false);
    response_.body() = std::move(body);
    response_.prepare_payload();
    stream_.expires_after(slow_line);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](beast::error_code, std::size_t) {
                        beast::error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  http::request_parser<http::empty_body> parser_;
  http::response<http::string_body> response_;
};

void ViewServer::Impl::visit(tcp::socket socket) {
  std::make_shared<Visit>(*this, std::move(socket))->begin();
}

void ViewServer::Impl::join(std::shared_ptr<Page> page) {
  page->send({make_text(pages_.empty() ? R"({"role": "steers"})" : R"({"role": "watches"})")});
  pages_.push_back(std::move(page));
  ++joins_;
  count_wishes();
}

void ViewServer::Impl::leave(const std::shared_ptr<Page>& page) {
  const auto found = std::find(pages_.begin(), pages_.end(), page);
  if (found == pages_.end()) return;
  const bool steered = found == pages_.begin();
  pages_.erase(found);
  if (steered) {
    keep(R"({"do": "drop"})");  // what it held would be held for ever
    if (!pages_.empty()) pages_.front()->send({make_text(R"({"role": "steers"})")});
  }
  count_wishes();
}

void ViewServer::Impl::pass_on(const Outgoing& what) {
  const std::vector<std::shared_ptr<Page>> all = pages_;  // pages may leave
  for (const auto& page : all) page->send(what);
  count_wishes();
}

void ViewServer::Impl::receive(Page& from, std::string text) {
  if (is_seen(text)) {
    from.has_seen();
    count_wishes();
    arrived_.notify_one();
  } else if (!pages_.empty() && pages_.front().get() == &from) {
    keep(std::move(text));
  }
}

void ViewServer::Impl::keep(std::string message) {
  {
    const std::lock_guard lock(mutex_);
    const auto moves = [](const std::string& text) { return text.starts_with(R"({"do":"move")"); };
    if (!messages_.empty() && moves(messages_.back()) && moves(message)) messages_.pop_back();
    // A hand must let go, whatever waits.
    const bool drops = message.find(R"("drop")") != std::string::npos;
    if (messages_.size() < most_unread_messages || drops) messages_.push_back(std::move(message));
  }
  arrived_.notify_one();
}

void ViewServer::Impl::count_wishes() {
  bool wanted = false;
  for (const auto& page : pages_) wanted = wanted || page->wants_frame();
  wants_frame_ = wanted;
  watchers_ = pages_.size();
}

bool has_view_server() { return true; }

ViewServer::ViewServer(const std::string& host, int port, std::string page)
    : impl_(std::make_unique<Impl>(host, std::move(page))) {
  impl_->listen(port);
  impl_->start();
}

ViewServer::~ViewServer() { impl_->stop(); }

std::string ViewServer::address() const { return impl_->address(); }

std::size_t ViewServer::watchers() const { return impl_->watchers_; }

std::size_t ViewServer::joins() const { return impl_->joins_; }

std::vector<std::string> ViewServer::take_messages() {
  const std::lock_guard lock(impl_->mutex_);
  std::vector<std::string> taken(impl_->messages_.begin(), impl_->messages_.end());
  impl_->messages_.clear();
  return taken;
}

void ViewServer::wait_for_message(std::chrono::milliseconds most) {
  std::unique_lock lock(impl_->mutex_);
  if (impl_->messages_.empty()) impl_->arrived_.wait_for(lock, most);
}

bool ViewServer::wants_frame() const { return impl_->wants_frame_; }

void ViewServer::send_frame(std::shared_ptr<const std::string> frame) {
  impl_->send({std::move(frame), true});
}

void ViewServer::send_text(std::string text) { impl_->send({Impl::make_text(std::move(text))}); }

}  // namespace phyxel::app
