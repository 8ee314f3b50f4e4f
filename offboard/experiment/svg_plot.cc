#include "offboard/experiment/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <fmt/format.h>

namespace vantage {
namespace {

// px
constexpr double kLeft = 84, kTop = 34, kWide = 480, kHigh = 300;
constexpr double kWidth = 770, kHeight = 386, kLegendLine = 20;

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '&') {
      out += "&amp;";
    } else {
      out += c;
    }
  }
  return out;
}

std::vector<double> axis_ticks(double low, double high, int count) {
  const double span = high > low ? high - low : std::max(1.0, std::abs(low));
  const double power = std::pow(10, std::floor(std::log10(span / count)));
  double step = power;
  for (const double factor : {2.0, 5.0, 10.0}) {
    if (span / step > count) step = factor * power;
  }
  std::vector<double> ticks;
  const auto first = static_cast<std::int64_t>(std::floor(low / step + 1e-9));
  for (std::int64_t i = first;; ++i) {
    ticks.push_back(static_cast<double>(i) * step);
    if (ticks.size() > 1 && ticks.back() >= high - 1e-9 * span) return ticks;
  }
}

std::string svg_of(const Plot& plot) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double x_low = kInfinity, x_high = -kInfinity, y_low = kInfinity, y_high = -kInfinity;
  for (const PlotCurve& curve : plot.curves) {
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      x_low = std::min(x_low, curve.x[i]);
      x_high = std::max(x_high, curve.x[i]);
      y_low = std::min(y_low, curve.low[i]);
      y_high = std::max(y_high, curve.high[i]);
    }
  }
  if (!(x_low <= x_high)) x_low = y_low = 0, x_high = y_high = 1;
  const std::vector<double> x_ticks = axis_ticks(x_low, x_high, 10), y_ticks = axis_ticks(y_low, y_high, 8);
  const auto px = [&](double x) { return kLeft + kWide * (x - x_ticks.front()) / (x_ticks.back() - x_ticks.front()); };
  const auto py = [&](double y) {
    return kTop + kHigh - kHigh * (y - y_ticks.front()) / (y_ticks.back() - y_ticks.front());
  };

  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n"
      "<text x=\"{2}\" y=\"20\" font-size=\"15\" font-weight=\"bold\">{3}</text>\n",
      kWidth, kHeight, kLeft, escaped(plot.title));
  for (const double x : x_ticks) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1}V{2}\" stroke=\"#e4e4e4\"/><text x=\"{0:.1f}\" y=\"{3}\" "
        "text-anchor=\"middle\">{4:.6g}</text>\n",
        px(x), kTop, kTop + kHigh, kTop + kHigh + 17, x);
  }
  for (const double y : y_ticks) {
    svg += fmt::format(
        "<path d=\"M{0} {1:.1f}H{2}\" stroke=\"#e4e4e4\"/><text x=\"{3}\" y=\"{4:.1f}\" "
        "text-anchor=\"end\">{5:.7g}</text>\n",
        kLeft, py(y), kLeft + kWide, kLeft - 6, py(y) + 4, y);
  }
  svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", kLeft + kWide / 2, kHeight - 14,
                     escaped(plot.x_label));
  svg += fmt::format("<text transform=\"translate(16 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                     kTop + kHigh / 2, escaped(plot.y_label));
  const auto path = [&](const std::vector<double>& x, const std::vector<double>& y, bool backwards) {
    std::string points;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const std::size_t at = backwards ? x.size() - 1 - i : i;
      points += fmt::format("{}{:.1f} {:.1f}", points.empty() ? "" : "L", px(x[at]), py(y[at]));
    }
    return points;
  };
  for (const PlotCurve& curve : plot.curves) {
    if (curve.x.size() < 2 || curve.low == curve.high) continue;
    svg += fmt::format("<path d=\"M{}L{}Z\" fill=\"{}\" fill-opacity=\"0.10\"/>\n", path(curve.x, curve.low, false),
                       path(curve.x, curve.high, true), curve.colour);
  }
  double legend_y = kTop + 10;
  for (const PlotCurve& curve : plot.curves) {
    const std::string stroke = fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}", curve.colour,
                                           curve.width, curve.dashed ? " stroke-dasharray=\"6 4\"" : "");
    if (curve.x.size() > 1) svg += fmt::format("<path d=\"M{}\" {}/>\n", path(curve.x, curve.mean, false), stroke);
    const double legend_x = kLeft + kWide + 18;
    svg += fmt::format("<path d=\"M{0} {1}h26\" {2}/><text x=\"{3}\" y=\"{4}\">{5}</text>\n", legend_x, legend_y,
                       stroke, legend_x + 34, legend_y + 4, escaped(curve.name));
    legend_y += kLegendLine;
  }
  svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#444\"/>\n</svg>\n",
                     kLeft, kTop, kWide, kHigh);
  return svg;
}

}  // namespace vantage
