/// Fuzzer of the requests of a live view's page and of recorded sessions: any text gives a request,
/// which comes back as it was, or an InputError.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "phyxel/error.hpp"
#include "view/recording.hpp"
#include "view/request.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const phyxel::app::Request request = phyxel::app::parse_request(text);
    if (phyxel::app::parse_request(phyxel::app::json_of(request).dump()) != request) std::abort();
  } catch (const phyxel::InputError&) {
  }
  try {
    phyxel::app::parse_recording(text, "session.jsonl");
  } catch (const phyxel::InputError&) {
  }
  return 0;
}
