#include "tunnel_pilot/rviz/hud_painter.h"

#include <QColor>
#include <QFont>
#include <QPainter>
#include <algorithm>
#include <cmath>

namespace tunnel_pilot::hud {
namespace {

// Pixels at scale 1.
constexpr int kWidth = 936, kHeight = 122, kMargin = 14, kGap = 20;
constexpr int kTitle = 11, kSmall = 13, kBadge = 17, kReason = 15, kLarge = 22;  // letters
constexpr int kTitleLine = 23, kLargeLine = 48, kFirstLine = 69, kSecondLine = 86,
              kLast = 107;  // baselines
constexpr int kUpperBar = 53, kLowerBar = 99, kBarHeight = 8;

struct Column {
  int left, width;
};
constexpr Column after(const Column& column, int width, int gap = kGap) {
  return {column.left + column.width + gap, width};
}
constexpr Column kStateColumn{kMargin, 190};
constexpr Column kSpeedColumn = after(kStateColumn, 138);
constexpr Column kArticulationColumn = after(kSpeedColumn, 108);
constexpr Column kTunnelColumn = after(kArticulationColumn, 112);
constexpr Column kNetworkColumn = after(kTunnelColumn, 106);
constexpr Column kChart = after(kNetworkColumn, 92, 0);
constexpr Column kAgesColumn = after(kChart, 62);
static_assert(kAgesColumn.left + kAgesColumn.width + kMargin == kWidth);

const QColor kBackground(14, 17, 22, 205);
const QColor kTrack(58, 64, 74);
const QColor kTitleColor(138, 148, 160);
const QColor kLine(255, 255, 255, 26);
const QColor kMark(245, 245, 250);
const QColor kBadgeLetters(12, 14, 18);

QColor color(Tone tone) {
  switch (tone) {
    case Tone::kGood:
      return {66, 190, 120};
    case Tone::kStandby:
      return {150, 172, 200};
    case Tone::kCaution:
      return {240, 180, 60};
    case Tone::kAlarm:
      return {232, 82, 74};
    case Tone::kStale:
      return {104, 112, 122};
    case Tone::kNormal:
      break;
  }
  return {236, 240, 244};
}

QFont font(int height, bool is_bold = false) {
  QFont f(QStringLiteral("DejaVu Sans"));
  f.setStyleHint(QFont::SansSerif);
  f.setPixelSize(height);
  f.setBold(is_bold);
  return f;
}

/// Draws one column of the strip.
class ColumnPainter {
 public:
  ColumnPainter(QPainter& painter, const Column& column) : painter_(painter), column_(column) {}

  void title(const char* words, int baseline = kTitleLine) {
    write(QString::fromLatin1(words), baseline, font(kTitle), kTitleColor);
  }
  void besideTitle(const Text& text) { writeRight(text, kTitleLine, font(kTitle), column_.width / 2); }
  void beside(const Text& text, int baseline) {
    writeRight(text, baseline, font(kSmall), 2 * column_.width / 3);
  }
  void line(const Text& text, int baseline) { write(text, baseline, font(kSmall)); }
  void large(const Text& text) { write(text, kLargeLine, font(kLarge, true)); }

  /// A word before a value, at the column's edges.
  void pair(const char* name, const Text& value, int baseline) {
    write(QString::fromLatin1(name), baseline, font(kSmall), kTitleColor);
    beside(value, baseline);
  }

  /// From the left edge.
  void bar(const Gauge& gauge, int top) {
    track(top);
    if (gauge.value) fill(0.0, *gauge.value, gauge.tone, top);
    if (gauge.mark) mark(*gauge.mark, top);
  }

  /// From the middle; what is positive goes to the left, as on the floor.
  void signedBar(const Gauge& gauge, int top) {
    track(top);
    if (gauge.value) fill(0.5, 0.5 - 0.5 * *gauge.value, gauge.tone, top);
    painter_.fillRect(at(0.5), top, 1, kBarHeight, kTitleColor);
    if (gauge.mark) mark(0.5 - 0.5 * *gauge.mark, top);
  }

  void badge(const Text& state) {
    painter_.setFont(font(kBadge, true));
    const QString text = QString::fromStdString(state.text);
    const QRect box(column_.left, 12, painter_.fontMetrics().horizontalAdvance(text) + 22, 28);
    painter_.fillRect(box, color(state.tone));
    painter_.setPen(kBadgeLetters);
    painter_.drawText(box, Qt::AlignCenter, text);
  }

  /// In as many lines as there is room for.
  void wrapped(const Text& text, int top, const QFont& f) {
    painter_.setFont(f);
    painter_.setPen(color(text.tone));
    painter_.drawText(QRect(column_.left, top, column_.width, kHeight - top), Qt::TextWordWrap,
                      QString::fromStdString(text.text));
  }

  /// The outputs, the leftmost articulation to the left, with the decoded one and a mark.
  void chart(const std::vector<double>& outputs, const Gauge& gauge, int top, int height) {
    painter_.fillRect(column_.left, top + height, column_.width, 1, kTrack);
    const double step = column_.width / std::max(1.0, static_cast<double>(outputs.size()));
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      const double bar = std::max(1.0, outputs[i] * height);
      const double left = column_.left + column_.width - (static_cast<double>(i) + 1.0) * step;
      painter_.fillRect(QRectF(left, top + height - bar, step - 0.8, bar), color(gauge.tone));
    }
    const auto inChart = [&](double value) {
      return column_.left + column_.width - 0.5 * step - 0.5 * (value + 1.0) * (column_.width - step);
    };
    if (gauge.mark) needle(inChart(*gauge.mark), top + height + 2, 6, color(Tone::kCaution));
    if (gauge.value) needle(inChart(*gauge.value), top + height + 2, 6, kMark);
  }

 private:
  void write(const Text& text, int baseline, const QFont& f) {
    write(QString::fromStdString(text.text), baseline, f, color(text.tone));
  }
  // What is too wide for its room is written smaller, then cut.
  QString fitted(const QString& text, QFont f, int room) {
    painter_.setFont(f);
    while (f.pixelSize() > kTitle && painter_.fontMetrics().horizontalAdvance(text) > room) {
      f.setPixelSize(f.pixelSize() - 1);
      painter_.setFont(f);
    }
    return painter_.fontMetrics().elidedText(text, Qt::ElideRight, room);
  }
  void write(const QString& text, int baseline, const QFont& f, const QColor& c) {
    const QString shown = fitted(text, f, column_.width);
    painter_.setPen(c);
    painter_.drawText(column_.left, baseline, shown);
  }
  void writeRight(const Text& text, int baseline, const QFont& f, int room) {
    const QString shown = fitted(QString::fromStdString(text.text), f, room);
    painter_.setPen(color(text.tone));
    const int width = painter_.fontMetrics().horizontalAdvance(shown);
    painter_.drawText(column_.left + column_.width - width, baseline, shown);
  }

  int at(double share) const {
    return column_.left + static_cast<int>(std::lround(share * column_.width));
  }
  void track(int top) { painter_.fillRect(column_.left, top, column_.width, kBarHeight, kTrack); }
  void fill(double from, double to, Tone tone, int top) {
    const int left = at(std::min(from, to));
    painter_.fillRect(left, top, std::max(1, at(std::max(from, to)) - left), kBarHeight, color(tone));
  }
  void mark(double share, int top) {
    painter_.fillRect(at(share) - 1, top - 3, 3, kBarHeight + 6, kMark);
  }
  void needle(double x, int top, int height, const QColor& c) {
    painter_.fillRect(QRectF(x - 1.5, top, 3.0, height), c);
  }

  QPainter& painter_;
  Column column_;
};

void paintState(const HudContent& content, QPainter& painter) {
  ColumnPainter column(painter, kStateColumn);
  column.badge(content.state);
  column.wrapped(content.reason, 46, font(kReason, true));
  const bool has_mode = !content.mode.text.empty();
  column.line(has_mode ? content.mode : Text{"steered by", Tone::kStale}, kLast);
  column.beside(content.source, kLast);
}

void paintSpeed(const HudContent& content, QPainter& painter) {
  ColumnPainter column(painter, kSpeedColumn);
  column.title("SPEED");
  column.besideTitle(content.speed_limit);
  column.large(content.speed);
  column.line(content.asked_speed, kFirstLine);
  column.line(content.limited_by, kSecondLine);
  column.bar(content.speed_gauge, kLowerBar);
}

void paintArticulation(const HudContent& content, QPainter& painter) {
  ColumnPainter column(painter, kArticulationColumn);
  column.title("ARTICULATION");
  column.large(content.articulation);
  column.line(content.commanded, kFirstLine);
  column.signedBar(content.articulation_gauge, kLowerBar);
}

void paintTunnel(const HudContent& content, QPainter& painter) {
  ColumnPainter column(painter, kTunnelColumn);
  column.title("IN THE TUNNEL");
  if (!content.no_tunnel.text.empty()) {
    column.wrapped(content.no_tunnel, 34, font(kSmall));
    return;
  }
  column.pair("offset", content.lateral, 46);
  column.signedBar(content.lateral_gauge, kUpperBar);
  column.pair("heading", content.heading, kLast - 15);
  column.signedBar(content.heading_gauge, kLowerBar);
}

void paintNetwork(const HudContent& content, QPainter& painter) {
  ColumnPainter column(painter, kNetworkColumn);
  column.title("NETWORK");
  column.large(content.network_angle);
  column.line(content.confidence, kFirstLine);
  column.line(content.model, kSecondLine);
  column.line(content.hash, kLast);
  ColumnPainter(painter, kChart).chart(content.outputs, content.network_gauge, 16, 82);
}

void paintAges(const HudContent& content, QPainter& painter) {
  ColumnPainter column(painter, kAgesColumn);
  column.title("SCAN AGE");
  column.line(content.scan_age, 44);
  column.title("CAN AGE", 78);
  column.line(content.feedback_age, 99);
}

}  // namespace

QSize hudSize() { return {kWidth, kHeight}; }

QImage paintHud(const HudContent& content, double scale) {
  QImage image(static_cast<int>(kWidth * scale), static_cast<int>(kHeight * scale),
               QImage::Format_ARGB32_Premultiplied);
  image.fill(Qt::transparent);
  QPainter painter(&image);
  painter.setRenderHints(QPainter::Antialiasing | QPainter::TextAntialiasing);
  painter.scale(scale, scale);
  painter.setPen(Qt::NoPen);
  painter.setBrush(kBackground);
  painter.drawRoundedRect(QRectF(0, 0, kWidth, kHeight), 8, 8);
  for (const Column& column :
       {kSpeedColumn, kArticulationColumn, kTunnelColumn, kNetworkColumn, kAgesColumn}) {
    painter.fillRect(column.left - kGap / 2, kMargin, 1, kHeight - 2 * kMargin, kLine);
  }
  paintState(content, painter);
  paintSpeed(content, painter);
  paintArticulation(content, painter);
  paintTunnel(content, painter);
  paintNetwork(content, painter);
  paintAges(content, painter);
  return image;
}

}  // namespace tunnel_pilot::hud
