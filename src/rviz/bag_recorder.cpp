#include "tunnel_pilot/rviz/bag_recorder.h"

#include <ros/master.h>
#include <ros/names.h>
#include <signal.h>

#include <QDateTime>
#include <QDir>
#include <QFileInfo>
#include <QProcessEnvironment>

namespace tunnel_pilot::hud {
namespace {

constexpr int kClosing = 5000;  // a bag is given to be closed when rviz ends [ms]

QString lastLine(const QByteArray& output) {
  const auto lines = QString::fromLocal8Bit(output).split('\n');
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) {
    if (!line->trimmed().isEmpty()) return line->trimmed();
  }
  return {};
}

}  // namespace

BagRecorder::BagRecorder(QObject* parent) : QObject(parent) {
  process_.setProcessChannelMode(QProcess::MergedChannels);
  connect(&process_, QOverload<int, QProcess::ExitStatus>::of(&QProcess::finished), this,
          &BagRecorder::onFinished);
  connect(&process_, &QProcess::started, this, [this] { Q_EMIT told(true, "recording " + file_); });
  connect(&process_, &QProcess::errorOccurred, this, [this](QProcess::ProcessError error) {
    if (error == QProcess::FailedToStart) {
      Q_EMIT told(false, "cannot record: " + process_.errorString());
    }
  });
}

BagRecorder::~BagRecorder() {
  process_.disconnect(this);
  if (!isRecording()) return;
  stop();
  if (!process_.waitForFinished(kClosing)) process_.kill();
  process_.waitForFinished();
}

void BagRecorder::start(const QString& folder, const QStringList& topics) {
  if (isRecording()) return;
  if (!QDir().mkpath(folder)) {
    Q_EMIT told(false, "cannot make the folder " + folder);
    return;
  }
  const QString name = QDateTime::currentDateTime().toString("yyyy-MM-dd-HH-mm-ss");
  file_ = QDir(folder).absoluteFilePath("tunnel_pilot_" + name + ".bag");
  auto environment = QProcessEnvironment::systemEnvironment();
  environment.insert("ROS_MASTER_URI", QString::fromStdString(ros::master::getURI()));
  process_.setProcessEnvironment(environment);
  // rosrun becomes the recorder itself: one process, which hears the signals. `rosbag record` would be a
  // parent that keeps them from it.
  QStringList arguments{"--pdeathsig", "INT", "rosrun", "rosbag", "record", "-O", file_};
  for (const QString& topic : topics) {
    arguments << QString::fromStdString(ros::names::resolve(topic.toStdString()));
  }
  process_.start("setpriv", arguments);
}

void BagRecorder::stop() {
  if (process_.processId() > 0) ::kill(static_cast<pid_t>(process_.processId()), SIGINT);
}

void BagRecorder::onFinished() {
  const QFileInfo bag(file_);
  if (bag.exists()) {
    Q_EMIT told(true,
                QString("%1 (%2 MB)").arg(file_).arg(1e-6 * static_cast<double>(bag.size()), 0, 'f', 1));
  } else {
    Q_EMIT told(false, "nothing was recorded: " + lastLine(process_.readAll()));
  }
}

}  // namespace tunnel_pilot::hud
