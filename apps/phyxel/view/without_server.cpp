/// The server of a build without Boost.Beast: there is none.
#include "phyxel/error.hpp"
#include "view/server.hpp"

namespace phyxel::app {

class ViewServer::Impl {};

bool has_view_server() { return false; }

ViewServer::ViewServer(const std::string&, int, std::string) {
  throw InputError(
      "phyxel view: this program was built without Boost.Beast, which serves the page; allowed: "
      "--headless, or a build with it (libboost-dev)");
}
ViewServer::~ViewServer() = default;
std::string ViewServer::address() const { return {}; }
std::size_t ViewServer::watchers() const { return 0; }
std::size_t ViewServer::joins() const { return 0; }
std::vector<std::string> ViewServer::take_messages() { return {}; }
void ViewServer::wait_for_message(std::chrono::milliseconds) {}
bool ViewServer::wants_frame() const { return false; }
void ViewServer::send_frame(std::shared_ptr<const std::string>) {}
void ViewServer::send_text(std::string) {}

}  // namespace phyxel::app
