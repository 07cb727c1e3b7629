#include "tunnel_pilot/rviz/panel.h"

#include <ros/package.h>

#include <QDir>
#include <QFile>
#include <QFileDialog>
#include <QGridLayout>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QVBoxLayout>
#include <QXmlStreamReader>
#include <pluginlib/class_list_macros.hpp>

#include "tunnel_pilot/rviz/bag_recorder.h"
#include "tunnel_pilot/rviz/service_caller.h"

namespace tunnel_pilot::hud {
namespace {

// The topics that record.launch records; none where there is no such file.
QStringList topicsOfRecordLaunch() {
  QFile file(QString::fromStdString(ros::package::getPath("tunnel_pilot")) + "/launch/record.launch");
  file.open(QIODevice::ReadOnly);
  QXmlStreamReader xml(&file);
  while (!xml.atEnd()) {
    if (xml.readNext() != QXmlStreamReader::StartElement || xml.name() != QLatin1String("arg")) continue;
    const auto attributes = xml.attributes();
    if (attributes.value("name") != QLatin1String("topics")) continue;
    return attributes.value("default").toString().simplified().split(' ');
  }
  return {};
}

void tell(QLabel& label, bool good, const QString& words) {
  label.setStyleSheet(good ? "color: #1f7a45" : "color: #b3261e");
  label.setText(words);
}

// Wraps, and keeps its room when it is empty.
QLabel* makeLabel(const char* name) {
  auto* label = new QLabel;
  label->setObjectName(name);
  label->setWordWrap(true);
  label->setAlignment(Qt::AlignLeft | Qt::AlignTop);
  label->setMinimumHeight(2 * label->fontMetrics().lineSpacing());
  label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  return label;
}

}  // namespace

Panel::Panel(QWidget* parent)
    : rviz::Panel(parent),
      topics_(topicsOfRecordLaunch()),
      caller_(new ServiceCaller(this)),
      recorder_(new BagRecorder(this)),
      answer_(makeLabel("answer")) {
  auto* buttons = new QGridLayout;
  buttons->addWidget(addButton("Engage", "the pilot drives, once all is healthy", {"engage"}), 0, 0);
  buttons->addWidget(addButton("Release", "the truck back to its operator", {"release"}), 0, 1);
  auto* stop = addButton("Stop", "brakes to a standstill", {"stop", "arbiter/stop"});
  stop->setStyleSheet("background: #c62828; color: white; font-weight: bold");
  stop->setMinimumHeight(44);
  buttons->addWidget(stop, 1, 0, 1, 2);
  buttons->addWidget(addButton("Reset", "after a stop, at standstill", {"reset", "arbiter/reset"}), 2, 0,
                     1, 2);
  buttons->addWidget(
      addButton("Lidar driver", "the network steers while it is sure", {"arbiter/use/lidar_driver"}), 3,
      0);
  buttons->addWidget(
      addButton("Preview driver", "steers without the network", {"arbiter/use/preview_driver"}), 3, 1);
  auto* layout = new QVBoxLayout(this);
  layout->addLayout(buttons);
  layout->addWidget(answer_);
  layout->addWidget(makeRecorder());
  layout->addStretch();
  connect(caller_, &ServiceCaller::answered, this,
          [this](bool accepted, const QString& words) { tell(*answer_, accepted, words); });
}

QPushButton* Panel::addButton(const char* name, const char* tip, std::vector<std::string> services) {
  auto* button = new QPushButton(name);
  button->setObjectName(QString::fromStdString(services.front()));
  button->setToolTip(tip);
  connect(button, &QPushButton::clicked, this, [this, services = std::move(services)] {
    tell(*answer_, true, QString::fromStdString(services.front()) + " ...");
    caller_->call(services);
  });
  return button;
}

QWidget* Panel::makeRecorder() {
  record_ = new QPushButton("Record");
  record_->setObjectName("record");
  record_->setCheckable(true);
  folder_ = new QLineEdit(QDir::home().filePath(".ros"));
  folder_->setObjectName("folder");
  folder_->setToolTip("folder of the bags");
  auto* choose = new QPushButton("...");
  choose->setFixedWidth(32);
  recording_ = makeLabel("recording");
  auto* box = new QWidget;
  auto* layout = new QGridLayout(box);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(record_, 0, 0, 1, 2);
  layout->addWidget(folder_, 1, 0);
  layout->addWidget(choose, 1, 1);
  layout->addWidget(recording_, 2, 0, 1, 2);
  connect(record_, &QPushButton::clicked, this, &Panel::toggleRecording);
  connect(choose, &QPushButton::clicked, this, &Panel::chooseFolder);
  connect(folder_, &QLineEdit::editingFinished, this, &Panel::configChanged);
  connect(recorder_, &BagRecorder::told, this, [this](bool good, const QString& words) {
    tell(*recording_, good, words);
    record_->setChecked(recorder_->isRecording());
    record_->setText(recorder_->isRecording() ? "Stop recording" : "Record");
  });
  return box;
}

void Panel::toggleRecording() {
  if (recorder_->isRecording()) {
    recorder_->stop();
  } else {
    recorder_->start(folder_->text(), topics_);
  }
  record_->setChecked(recorder_->isRecording());
}

void Panel::chooseFolder() {
  const QString folder = QFileDialog::getExistingDirectory(this, "Folder of the bags", folder_->text());
  if (folder.isEmpty()) return;
  folder_->setText(folder);
  Q_EMIT configChanged();
}

void Panel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  QString folder, topics;
  if (config.mapGetString("Record Folder", &folder)) folder_->setText(folder);
  if (config.mapGetString("Record Topics", &topics)) topics_ = topics.simplified().split(' ');
}

void Panel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Record Folder", folder_->text());
  config.mapSetValue("Record Topics", topics_.join(' '));
}

}  // namespace tunnel_pilot::hud

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::hud::Panel, rviz::Panel)
