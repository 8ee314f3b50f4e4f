#pragma once

#include <string>
#include <vector>

namespace vantage {

/// One curve: the means, and the band between the least and the largest of what was averaged.
struct PlotCurve {
  std::string name;
  std::string colour;  ///< as SVG has it: "#c00"
  double width = 1.5;  ///< px
  bool dashed = false;
  std::vector<double> x, mean, low, high;  ///< of equal length; finite
};

struct Plot {
  std::string title, x_label, y_label;
  std::vector<PlotCurve> curves;
};

/// A line plot with axes and legend as an SVG element, which stands by itself or inside HTML. Curves of one point have
/// no line; names are written as they are but for <, > and &.
std::string svg_of(const Plot& plot);

/// About `count` round numbers (1, 2 or 5 times a power of ten) that span [low, high], ends included or overshot.
std::vector<double> axis_ticks(double low, double high, int count);

/// Text for between HTML's tags.
std::string escaped(const std::string& text);

}  // namespace vantage
