/// The web server of a live view.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace phyxel::app {

/// True if the program was built with the library of the server.
bool has_view_server();

/// A server of one page and of one stream of messages, on a thread of its own. The first page that
/// connects steers; others watch, until it leaves. Only addresses with the token are answered, and
/// only those whose headers Host and Origin name this server, so that no other page of a browser
/// can reach it.
class ViewServer {
 public:
  /// @param host address of this machine to listen at @param port 0: any that is free
  /// @param page served as "/"
  /// @throws InputError if the address is none of this machine's, or the port is taken
  ViewServer(const std::string& host, int port, std::string page);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// The page's address, with the token, e.g. "http://127.0.0.1:8080/?token=...".
  std::string address() const;
  /// Number of connected pages.
  std::size_t watchers() const;
  /// Number of pages that have connected so far.
  std::size_t joins() const;
  /// The messages of the page that steers since the last call; at most a thousand, the oldest.
  std::vector<std::string> take_messages();
  /// Waits until there is a message, or for some time.
  void wait_for_message(std::chrono::milliseconds most);
  /// True if a page has drawn all but one of the frames sent to it, so that frames never queue. A
  /// page says so by the message {"do":"seen"}, which is not among the messages.
  bool wants_frame() const;
  /// Sends a frame to the pages that want one.
  void send_frame(std::shared_ptr<const std::string> frame);
  /// Sends a text to all pages. Pages that do not read are disconnected.
  void send_text(std::string text);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace phyxel::app
