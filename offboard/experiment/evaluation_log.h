#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vantage {

/// Values that a search has paid for, a line each as they come: NAME INDEX VALUE, behind a head that says what they are
/// values of. A line that was cut short by a kill is as if it were not there.
class EvaluationLog {
 public:
  /// Opens or begins the log. `head`: lines; none is empty.
  /// \throws InputError when the file has another head, or can't be written.
  EvaluationLog(std::filesystem::path path, const std::string& head);

  /// Value `index` (from 0) of a search's; nothing when it was not paid for.
  std::optional<double> find(const std::string& name, std::size_t index) const;
  /// \throws InputError when it can't be written (a full disk).
  void add(const std::string& name, std::size_t index, double value);

 private:
  std::filesystem::path path_;
  std::map<std::pair<std::string, std::size_t>, double> values_;
  std::ofstream stream_;
};

}  // namespace vantage
