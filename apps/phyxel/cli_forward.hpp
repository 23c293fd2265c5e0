/// Names of CLI11 whose definitions, which are slow to compile, only the sources of commands need.
#pragma once

namespace CLI {
class App;
class ParseError;
}  // namespace CLI
