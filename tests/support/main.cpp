/// main() of the test programs, which counts the skips of GoogleTest.
#include <gmock/gmock.h>

#include "support/skips.hpp"

int main(int argc, char** argv) {
  ::testing::InitGoogleMock(&argc, argv);
  return phyxel::test::exit_code_of(RUN_ALL_TESTS());
}
