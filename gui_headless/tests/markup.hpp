#pragma once

#include <string>
#include <vector>

namespace vestibule::gui_headless {

/// Empty when every tag of an XML-like text is closed in order and every attribute value is quoted
/// without stray < or &; else what is wrong. Knows void <img .../> forms, comments are not used.
inline std::string markupProblem(const std::string& text) {
  std::vector<std::string> open;
  std::size_t i = 0;
  while (i < text.size()) {
    if (text[i] == '&') {
      const std::size_t end = text.find(';', i);
      if (end == std::string::npos || end - i > 7) return "bare & at " + text.substr(i, 30);
      i = end + 1;
      continue;
    }
    if (text[i] == '>') return "bare > at " + text.substr(i, 30);
    if (text[i] != '<') {
      ++i;
      continue;
    }
    // To the closing bracket, skipping quoted values.
    std::size_t end = i + 1;
    bool quoted = false;
    while (end < text.size() && (quoted || text[end] != '>')) {
      if (text[end] == '"') quoted = !quoted;
      if (text[end] == '<') return "< inside a tag at " + text.substr(i, 60);
      ++end;
    }
    if (end >= text.size()) return "unclosed tag at " + text.substr(i, 60);
    const std::string tag = text.substr(i + 1, end - i - 1);
    i = end + 1;
    if (tag[0] == '!') continue;
    if (tag.back() == '/') continue;
    const bool closes = tag[0] == '/';
    const std::string name = tag.substr(closes ? 1 : 0, tag.find(' ') - (closes ? 1 : 0));
    if (!closes) {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return "</" + name + "> closes <" + (open.empty() ? "nothing" : open.back()) + ">";
    } else {
      open.pop_back();
    }
    if (!closes && name == "style") {
      i = text.find("</style>", i);
      if (i == std::string::npos) return "style never ends";
    }
  }
  return open.empty() ? "" : "<" + open.back() + "> never closed";
}

inline std::size_t countOf(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

}  // namespace vestibule::gui_headless
