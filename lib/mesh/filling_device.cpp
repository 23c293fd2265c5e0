#include "mesh/filling_device.hpp"

#include <utility>

namespace phyxel {
namespace {

thread_local const FillingDevice* device_of_thread = nullptr;

}  // namespace

FillingScope::FillingScope(std::shared_ptr<const FillingDevice> device)
    : device_(std::move(device)), before_(std::exchange(device_of_thread, device_.get())) {}

FillingScope::~FillingScope() { device_of_thread = before_; }

const FillingDevice* FillingScope::device() { return device_of_thread; }

}  // namespace phyxel
