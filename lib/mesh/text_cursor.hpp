/// A cursor that reads text word by word and counts lines.
#pragma once

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace phyxel {

inline bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
}

/// The value of `word`, which may be infinite or NaN; unset if any part of it is not a number.
inline std::optional<double> parse_number(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

inline std::optional<long long> parse_integer(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  long long value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

/// The first 40 characters of a word for error messages, unprintable ones replaced by "?".
inline std::string printable(std::string_view word) {
  std::string shown(word.substr(0, 40));
  for (char& c : shown) c = c < ' ' || c > '~' ? '?' : c;
  return shown;
}

class TextCursor {
 public:
  explicit TextCursor(std::string_view text) : text_(text) {}

  /// The next word, or "" at the end.
  std::string_view word() {
    while (at_ < text_.size() && is_blank(text_[at_])) line_ += text_[at_++] == '\n';
    const std::size_t start = at_;
    while (at_ < text_.size() && !is_blank(text_[at_])) ++at_;
    return text_.substr(start, at_ - start);
  }

  /// The rest of the line, without its end.
  std::string_view rest_of_line() {
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    std::string_view rest = text_.substr(at_, end - at_);
    at_ = end;
    if (at_ < text_.size()) ++at_, ++line_;
    if (!rest.empty() && rest.back() == '\r') rest.remove_suffix(1);
    return rest;
  }

  std::size_t line() const { return line_; }  ///< Line of the last word, from 1.
  std::size_t offset() const { return at_; }  ///< Position from the start [bytes].
  std::size_t left() const { return text_.size() - at_; }

 private:
  std::string_view text_;
  std::size_t at_ = 0, line_ = 1;
};

}  // namespace phyxel
